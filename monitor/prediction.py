"""The terrain thread: which range bins the stored terrain should light, for every radial of a scan.

Young, Uijt de Haag and Campbell (2004), section 1.2, with three refinements a real beam needs. The thread runs on a
fan of azimuths across the beam and a bin is lit if any of them lights it; the ground point of a bin lies at its *slant*
range; the Earth's curvature with standard refraction lowers far terrain. Tangents are taken of the true elevation, with
the horizontal distance below the line where eq. (5) writes the slant range, since the beam's limits are tangents too.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor.geodesy import along, curvature_radii, ray
from monitor.shade import walk
from monitor.terrain import Grid, sample


class Beam(NamedTuple):
    """How the antenna is modelled."""

    width_deg: float = 3.5  # one-way 3 dB
    azimuth_fan: int = 7  # sub-azimuths; 1 is the paper's boresight form
    azimuth_span: float = 0.75  # beam widths each side, where the two-way gain is 13.5 dB down
    refraction_k: float = 4 / 3  # effective Earth radius factor; inf is the paper's flat Earth
    range_reference: str = "centre"  # or "far_edge", the paper's R_j = j dR


class Pointing(NamedTuple):
    """Where the antenna is and looks for each radial, arrays (n,): WGS 84 degrees, metres MSL, local-level radians."""

    latitude_deg: NDArray[np.float64]
    longitude_deg: NDArray[np.float64]
    height_m: NDArray[np.float64]
    azimuth_rad: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]


def predict(
    grid: Grid, pointing: Pointing, bins: int, bin_width_m: float, beam: Beam
) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
    """States of the terrain thread i1 (n, bins), and which radials (n,) met a void post or left the terrain."""
    offset = {"centre": 0.5, "far_edge": 0.0}[beam.range_reference]
    ranges_m = (np.arange(1, bins + 1) - offset) * bin_width_m
    width = math.radians(beam.width_deg)
    fan = width * beam.azimuth_span * np.linspace(-1, 1, beam.azimuth_fan) if beam.azimuth_fan > 1 else np.zeros(1)
    states, void = _predict(grid, *pointing, ranges_m, width / 2, fan, beam.refraction_k)
    return states, void


@njit(cache=True)
def _predict(  # type: ignore[no-untyped-def] # typed by predict
    grid, latitude_deg, longitude_deg, height_m, azimuth_rad, elevation_rad, ranges_m, half_beam_rad, fan_rad, k
):
    states = np.empty((azimuth_rad.size, ranges_m.size), np.int8)
    void = np.zeros(azimuth_rad.size, np.bool_)
    delta = np.empty(ranges_m.size)
    one = np.empty(ranges_m.size, np.int8)
    for i in range(azimuth_rad.size):
        dmin = math.tan(elevation_rad[i] - half_beam_rad)
        dmax = math.tan(elevation_rad[i] + half_beam_rad)
        for f in range(fan_rad.size):
            azimuth = azimuth_rad[i] + fan_rad[f]
            void[i] |= tangents(grid, latitude_deg[i], longitude_deg[i], height_m[i], azimuth, ranges_m, k, delta)
            walk(delta, dmin, dmax, one)
            for j in range(one.size):
                states[i, j] = one[j] if f == 0 else max(states[i, j], one[j])
    return states, void


@njit(cache=True)
def tangents(
    grid: Grid,
    latitude_deg: float,
    longitude_deg: float,
    height_m: float,
    azimuth_rad: float,
    ranges_m: NDArray[np.float64],
    k: float,
    delta: NDArray[np.float64],
) -> bool:
    """Tangent of the elevation of the ground at each slant range, into `delta`; True if any post was missing.

    Bins nearer than the ground below get -infinity, those from the first missing post on NaN. In the triangle of
    antenna, ground and the Earth's centre the slant range squared is the height difference squared plus the square of
    the chord at the mean height, whatever the curvature, so only the elevation sees the drop.
    """
    meridian, prime = curvature_radii(math.radians(latitude_deg))
    twice_radius = 2 * k * math.sqrt(meridian * prime)
    ground = sample(grid, latitude_deg, longitude_deg)
    if math.isnan(ground):
        ground = height_m
    r = ray(latitude_deg, longitude_deg, (height_m + ground) / 2, azimuth_rad)
    for j in range(ranges_m.size):
        for _ in range(2):  # the last bin's ground is a guess good enough for two corrections
            s2 = ranges_m[j] ** 2 - (height_m - ground) ** 2
            if s2 <= 0:
                break
            lat, lon = along(r, math.sqrt(s2))
            found = sample(grid, lat, lon)
            if math.isnan(found):
                delta[j:] = math.nan
                return True
            ground = found
        s2 = ranges_m[j] ** 2 - (height_m - ground) ** 2
        if s2 <= 0:
            delta[j] = -math.inf
        else:
            delta[j] = -(height_m - ground) / math.sqrt(s2) - math.sqrt(s2) / twice_radius
    return False
