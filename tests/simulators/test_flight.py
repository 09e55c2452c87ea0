"""True motion: consistent with itself, smooth, and the same whoever asks."""

import numpy as np
import pyproj
import pytest

from simulators.flight import Trajectory
from simulators.scenario import Flight, Leg

TURNING = Flight(
    latitude_deg=44.4,
    longitude_deg=-71.7,
    height_m=1000,
    heading_deg=350,
    ground_speed_mps=100,
    duration_s=20,
    turbulence_deg=0,
    legs=(Leg(heading_deg=80, duration_s=60, climb_mps=5),),
)


def test_the_truth_at_an_instant_does_not_depend_on_the_other_instants_asked_for() -> None:
    shaken = TURNING.model_copy(update={"turbulence_deg": 0.5})
    times = np.arange(0, 80, 0.02)
    whole = Trajectory(shaken, 3).at(times)
    part = Trajectory(shaken, 3).at(times[500:1000:2])
    assert np.array_equal(whole.roll_deg[500:1000:2], part.roll_deg)
    assert not np.array_equal(part.roll_deg, Trajectory(shaken, 4).at(part.time_s).roll_deg)


def test_displacement_over_a_second_has_the_stated_ground_speed_and_track() -> None:
    truth = Trajectory(TURNING, 0).at(np.arange(0, 80, 1.0))
    forward = pyproj.Geod(ellps="WGS84").inv(
        truth.longitude_deg[:-1], truth.latitude_deg[:-1], truth.longitude_deg[1:], truth.latitude_deg[1:]
    )
    at_height = forward[2] * (1 + truth.height_m[:-1] / 6.37e6)
    assert at_height == pytest.approx(truth.ground_speed_mps[:-1], abs=0.1)
    middle = (truth.track_deg[:-1] + truth.track_deg[1:]) / 2
    assert (forward[0] - middle + 180) % 360 - 180 == pytest.approx(np.zeros(79), abs=0.1)


def test_a_turn_goes_the_short_way_round_and_banks_for_its_rate() -> None:
    truth = Trajectory(TURNING, 0).at(np.arange(0, 80, 0.5))
    assert truth.heading_deg[-1] == pytest.approx(350 + 90)
    assert truth.heading_deg[40] == pytest.approx(350)
    rate = np.gradient(truth.heading_deg, 0.5)
    needed = np.degrees(np.arctan(100 * np.radians(rate) / 9.80665))
    assert truth.roll_deg == pytest.approx(needed, abs=0.3)
    assert 20 < truth.roll_deg.max() < 50


def test_height_is_the_integral_of_the_climb() -> None:
    truth = Trajectory(TURNING, 0).at(np.arange(0, 80.1, 0.1))
    gained = np.sum((truth.vertical_speed_mps[1:] + truth.vertical_speed_mps[:-1]) / 2) * 0.1
    assert truth.height_m[-1] - truth.height_m[0] == pytest.approx(gained, abs=0.1)
    assert gained == pytest.approx(5 * (60 - 2.5), abs=1)


def test_turbulence_has_its_deviation_on_every_axis_and_is_smooth() -> None:
    straight = Flight(latitude_deg=0, longitude_deg=0, height_m=0, heading_deg=0, duration_s=2000, turbulence_deg=0.4)
    truth = Trajectory(straight, 1).at(np.arange(0, 2000, 0.05))
    deviations = [np.std(axis) for axis in (truth.pitch_deg, truth.roll_deg, truth.heading_deg)]
    assert deviations == pytest.approx([0.4, 0.8, 0.2], rel=0.1)
    assert np.abs(np.diff(truth.roll_deg)).max() < 0.3
