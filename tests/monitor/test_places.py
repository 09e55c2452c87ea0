"""Where a range bin lies on the ground, against pyproj and triangles."""

from math import sqrt

import numpy as np
import pytest
from pyproj import Geod

from monitor.places import line, place
from monitor.prediction import Pointing
from monitor.terrain import Grid
from tests.monitor.ground import LATITUDE, LONGITUDE, distance_m, looking_north, mesa, plain

GEOD = Geod(ellps="WGS84")


def found(grid: Grid, pointing: Pointing, range_m: float) -> tuple[float, float, float]:
    track, below = line(grid, pointing, 0)
    return place(grid, track, float(pointing.height_m[0]), below, range_m)


@pytest.mark.parametrize(("height_m", "range_m"), [(500.0, 20_000.0), (1500.0, 1700.0), (3000.0, 5000.0)])
def test_over_a_plain_the_place_is_the_foot_of_a_right_triangle(height_m: float, range_m: float) -> None:
    """3-4-5 among them. A metre at the mean height of 1,600 m is shorter on the ellipsoid by 1 in 4,000."""
    latitude, longitude, ground = found(plain(100.0), looking_north(height_m + 100), range_m)
    assert float(distance_m(np.array([latitude]))[0]) == pytest.approx(sqrt(range_m**2 - height_m**2), rel=3e-4)
    assert longitude == pytest.approx(LONGITUDE, abs=1e-9)
    assert ground == pytest.approx(100.0)


def test_on_a_mountain_the_place_is_that_of_its_height() -> None:
    """From 700 m, 5,000 m slant to a top of 400 m is sqrt(5000^2 - 300^2) along, and not sqrt(5000^2 - 700^2)."""
    latitude, _, ground = found(mesa(4000, 6000, 400), looking_north(700), 5000.0)
    assert ground == pytest.approx(400.0)
    assert float(distance_m(np.array([latitude]))[0]) == pytest.approx(sqrt(5000**2 - 300**2), abs=1.0)


def test_the_azimuth_is_that_of_a_geodesic() -> None:
    pointing = looking_north(600.0)._replace(azimuth_rad=np.radians([30.0]))
    latitude, longitude, _ = found(plain(), pointing, 2000.0)
    east, north, _ = GEOD.fwd(LONGITUDE, LATITUDE, 30.0, sqrt(2000**2 - 600**2))
    assert GEOD.inv(longitude, latitude, east, north)[2] < 0.2


def test_nearer_than_the_ground_below_it_is_below_and_off_the_terrain_the_guess_stands() -> None:
    assert found(plain(), looking_north(600.0), 500.0)[:2] == pytest.approx((LATITUDE, LONGITUDE))
    latitude, _, ground = found(plain(100.0), looking_north(600.0), 90_000.0)
    assert ground == pytest.approx(100.0)
    assert float(distance_m(np.array([latitude]))[0]) == pytest.approx(90_000, rel=1e-3)
