"""What the navigation instruments measure: the truth, displaced by their errors and by the scenario's faults."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from simulators import scenario
from simulators.flight import Trajectory, Truth

Floats = NDArray[np.float64]
Measure = Callable[[Floats], Truth]

FEET, KNOTS = 1 / 0.3048, 3600 / 1852  # per metre, per metre a second
INERTIAL_STREAM, GNSS_STREAM = 5, 6
METRES_PER_DEGREE = 111_200.0  # good enough to scale errors


def inertial_measurement(settings: scenario.Scenario, trajectory: Trajectory) -> Measure:
    """Motion at times (n,) with a bias on each angle and on the altitude, a drifting position, and the faults."""
    rng = np.random.default_rng((settings.seed, INERTIAL_STREAM))
    pitch, roll, heading, track = rng.normal(0.0, settings.errors.inertial_angle_deg, 4)
    north, east = rng.normal(0.0, settings.errors.inertial_drift_mps, 2)
    height = rng.normal(0.0, settings.errors.inertial_altitude_m)
    turns = [fault for fault in settings.faults if fault.name == "heading_offset"]

    def measure(time_s: Floats) -> Truth:
        truth = trajectory.at(time_s)
        return replace(
            _moved(truth, north * time_s, east * time_s, height),
            pitch_deg=truth.pitch_deg + pitch,
            roll_deg=truth.roll_deg + roll,
            heading_deg=truth.heading_deg + heading + sum(turn.heading_deg * during(turn, time_s) for turn in turns),
            track_deg=truth.track_deg + track,
        )

    return measure


def gnss_measurement(settings: scenario.Scenario, trajectory: Trajectory) -> Measure:
    """Motion at times (n,) with biases, white noise by epoch, and the offsets of the scenario's faults."""
    rng = np.random.default_rng((settings.seed, GNSS_STREAM))
    errors = settings.errors
    bias = rng.normal(0.0, 1.0, 3) * (errors.gnss_position_deg, errors.gnss_position_deg, errors.gnss_altitude_m)
    epochs = math.ceil(settings.flight.total_s / settings.gnss_interval_s) + 1
    noise = rng.normal(0.0, errors.gnss_noise_m, (epochs, 3))
    offsets = [fault for fault in settings.faults if fault.name == "gnss_offset"]

    def measure(time_s: Floats) -> Truth:
        truth = trajectory.at(time_s)
        drawn = noise[np.minimum(np.rint(time_s / settings.gnss_interval_s).astype(np.int64), epochs - 1)].T
        away = drawn + sum((_offset(fault, time_s) for fault in offsets), np.zeros_like(drawn))
        moved = _moved(truth, *away)
        return replace(
            moved,
            latitude_deg=moved.latitude_deg + bias[0],
            longitude_deg=moved.longitude_deg + bias[1],
            height_m=moved.height_m + bias[2],
        )

    return measure


def during(fault: scenario.Fault, time_s: Floats) -> NDArray[np.bool_]:
    """At which of the times (n,) in seconds the fault lasts."""
    return (time_s >= fault.start_s) & (time_s < fault.stop_s)


def _moved(truth: Truth, north_m: Floats, east_m: Floats, up_m: Floats | float) -> Truth:
    """The truth displaced by metres (n,), small against the Earth."""
    squeeze = np.cos(np.radians(truth.latitude_deg))
    return replace(
        truth,
        latitude_deg=truth.latitude_deg + north_m / METRES_PER_DEGREE,
        longitude_deg=truth.longitude_deg + east_m / (METRES_PER_DEGREE * squeeze),
        height_m=truth.height_m + up_m,
    )


def _offset(fault: scenario.Fault, time_s: Floats) -> Floats:
    """North, east and up (3, n) in metres while the fault lasts."""
    return np.outer((fault.north_m, fault.east_m, fault.up_m), during(fault, time_s))
