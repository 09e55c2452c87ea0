"""The aircraft's true motion: constant-speed legs joined by smooth coordinated turns, shaken by turbulence.

Everything is fixed on a grid of instants when the flight is made and interpolated afterwards,
so the truth at an instant does not depend on who asks for it or when.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from simulators import scenario

Floats = NDArray[np.float64]

STEP_S = 0.1
TURBULENCE_STREAM = 2
TURBULENCE_TIME_S = 0.8
AXES = {"pitch_deg": 1.0, "roll_deg": 2.0, "heading_deg": 0.5}  # turbulence of each angle relative to the setting
ANGLE_OF_ATTACK_DEG = 2.5
GRAVITY = 9.80665
SEMI_MAJOR_M, ECCENTRICITY_SQUARED = 6_378_137.0, 6.69437999014e-3  # WGS 84


@dataclass(frozen=True)
class Truth:
    """The aircraft at n instants, arrays (n,): degrees, metres above mean sea level, metres a second; north is 0."""

    time_s: Floats
    latitude_deg: Floats
    longitude_deg: Floats
    height_m: Floats
    pitch_deg: Floats
    roll_deg: Floats
    heading_deg: Floats
    track_deg: Floats
    ground_speed_mps: Floats
    vertical_speed_mps: Floats


class Trajectory:
    """The whole flight, asked by `at`."""

    def __init__(self, flight: scenario.Flight, seed: int) -> None:
        time = np.arange(-1.0, flight.total_s + 1.0 + STEP_S, STEP_S)  # a second beyond each end for the spline
        heading, climb = _heading(flight, time), _climb(flight, time)
        height = flight.height_m + _from_start(time, climb)
        latitude, longitude = _positions(flight, time, heading + flight.drift_deg, height)
        shaken = _turbulence(flight.turbulence_deg, len(time), seed)
        turn_rate = np.gradient(heading, STEP_S)
        columns = {
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "height_m": height,
            "pitch_deg": np.degrees(np.arctan2(climb, flight.ground_speed_mps))
            + ANGLE_OF_ATTACK_DEG
            + shaken["pitch_deg"],
            "roll_deg": _bank(turn_rate, flight.ground_speed_mps) + shaken["roll_deg"],
            "heading_deg": heading + shaken["heading_deg"],
            "track_deg": heading + flight.drift_deg,
            "ground_speed_mps": np.full_like(time, flight.ground_speed_mps),
            "vertical_speed_mps": climb,
        }
        self._names = tuple(columns)
        self._spline = CubicSpline(time, np.stack(list(columns.values()), axis=1))

    def at(self, time_s: ArrayLike) -> Truth:
        """Truth at instants (n,) in seconds from the start of the flight; angles are continuous, not wrapped."""
        time = np.asarray(time_s, np.float64)
        return Truth(time, **dict(zip(self._names, self._spline(time).T, strict=True)))


def _heading(flight: scenario.Flight, time: Floats) -> Floats:
    """Straight, then for each further leg a raised-cosine turn rate of the given mean, the short way round."""
    heading = np.full_like(time, flight.heading_deg)
    start, current = flight.duration_s, flight.heading_deg
    for leg in flight.legs:
        change = (leg.heading_deg - current + 180) % 360 - 180
        lasting = max(abs(change) / flight.turn_rate_deg_s, STEP_S)
        part = np.clip((time - start) / lasting, 0.0, 1.0)
        heading += change * (part - np.sin(2 * math.pi * part) / (2 * math.pi))
        start, current = start + leg.duration_s, current + change
    return heading


def _climb(flight: scenario.Flight, time: Floats) -> Floats:
    """Vertical speed, changing over five seconds at the start of each leg."""
    climb = np.full_like(time, flight.climb_mps)
    start, current = flight.duration_s, flight.climb_mps
    for leg in flight.legs:
        part = np.clip((time - start) / 5.0, 0.0, 1.0)
        climb += (leg.climb_mps - current) * part * part * (3 - 2 * part)
        start, current = start + leg.duration_s, leg.climb_mps
    return climb


def _positions(flight: scenario.Flight, time: Floats, track_deg: Floats, height: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude in degrees from the velocity; the radii of curvature settle in the second round."""
    north = flight.ground_speed_mps * np.cos(np.radians(track_deg))
    east = flight.ground_speed_mps * np.sin(np.radians(track_deg))
    latitude = np.full_like(time, flight.latitude_deg)
    for _ in range(3):
        sine = np.sin(np.radians(latitude))
        squeezed = 1 - ECCENTRICITY_SQUARED * sine**2
        meridian = SEMI_MAJOR_M * (1 - ECCENTRICITY_SQUARED) / squeezed**1.5 + height
        normal = SEMI_MAJOR_M / np.sqrt(squeezed) + height
        latitude = flight.latitude_deg + np.degrees(_from_start(time, north / meridian))
    across = east / (normal * np.cos(np.radians(latitude)))
    return latitude, flight.longitude_deg + np.degrees(_from_start(time, across))


def _from_start(time: Floats, rate: Floats) -> Floats:
    """Integral (n,) of a rate, zero at time zero."""
    total = cumulative_trapezoid(rate, time, initial=0)
    return np.asarray(total - np.interp(0.0, time, total), np.float64)


def _bank(turn_rate_deg_s: Floats, speed_mps: float) -> Floats:
    """Bank of a coordinated turn: tan(roll) = V omega / g."""
    return np.degrees(np.arctan(speed_mps * np.radians(turn_rate_deg_s) / GRAVITY))


def _turbulence(deviation_deg: float, count: int, seed: int) -> dict[str, Floats]:
    """Second-order Gauss-Markov noise for each angle: white noise through two equal poles, scaled to its deviation."""
    pole = math.exp(-STEP_S / TURBULENCE_TIME_S)
    settled = 10 * round(TURBULENCE_TIME_S / STEP_S)
    white = np.random.default_rng((seed, TURBULENCE_STREAM)).normal(size=(len(AXES), settled + count))
    smooth = lfilter([1.0], [1.0, -2 * pole, pole**2], white)[:, settled:]
    gain = math.sqrt((1 - pole**2) ** 3 / (1 + pole**2))
    return {axis: deviation_deg * share * gain * row for (axis, share), row in zip(AXES.items(), smooth, strict=True)}
