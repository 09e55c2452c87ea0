"""The radar's ground echo against plane geometry."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from simulators.echo import Beam, Views, mean_echo
from simulators.terrain import Ground

Floats = NDArray[np.float64]
MakeGround = Callable[[Callable[[Floats, Floats], Floats]], Ground]

RANGE_M, BINS = 10_000.0, 400
BIN_M = RANGE_M / BINS
CENTRES_M = (np.arange(BINS) + 0.5) * BIN_M


def look(
    ground: Ground, height_m: float, *, bearing_deg: float = 0.0, tilt_deg: float = -2.0, width: float = 3.5
) -> Floats:
    at = np.zeros(1)
    views = Views(at, at, at + height_m, at + bearing_deg)
    return mean_echo(ground, views, Beam(tilt_deg, width), RANGE_M, BINS).ravel()


def test_flat_ground_answers_from_its_nearest_point_to_the_range_without_a_gap(make_ground: MakeGround) -> None:
    echo = look(make_ground(lambda x, y: 0 * x + 0 * y), 300.0)
    assert not echo[CENTRES_M < 300 - BIN_M].any()
    assert echo[CENTRES_M > 1700].all()  # nearer in, the beam's skirt is 150 dB down and counts as nothing


def test_echo_of_flat_ground_falls_with_the_fourth_power_of_range_for_constant_gamma(make_ground: MakeGround) -> None:
    height = 300.0
    echo = look(make_ground(lambda x, y: 0 * x + 0 * y), height, tilt_deg=0.0)
    near, far = (int(distance / BIN_M) for distance in (3000.0, 6000.0))
    off = np.degrees(np.arcsin(height / CENTRES_M[[near, far]]))
    fall = echo[far] / echo[near] / math.exp(-8 * math.log(2) * ((off[1] / 3.5) ** 2 - (off[0] / 3.5) ** 2))
    assert fall == pytest.approx((CENTRES_M[near] / CENTRES_M[far]) ** 4, rel=0.02)


@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, 200.0])
def test_a_wall_hides_the_ground_from_its_foot_to_where_the_ray_over_its_top_comes_down(
    make_ground: MakeGround, bearing_deg: float
) -> None:
    antenna, wall, distance = 400.0, 150.0, 4000.0

    def ring(x: Floats, y: Floats) -> Floats:
        return np.where(np.abs(np.hypot(x, y) - distance) < 15, wall, 0.0)

    echo = look(make_ground(ring), antenna, bearing_deg=bearing_deg)
    end = distance * antenna / (antenna - wall)
    dark = np.flatnonzero((echo == 0) & (CENTRES_M > 2500))
    assert dark[0] * BIN_M == pytest.approx(math.hypot(distance, antenna - wall), abs=2 * BIN_M)
    assert (dark[-1] + 1) * BIN_M == pytest.approx(math.hypot(end, antenna), abs=3 * BIN_M)
    assert np.all(np.diff(dark) == 1)
    wall_bin = int(math.hypot(distance, antenna - wall) / BIN_M)
    assert echo[wall_bin - 2 : wall_bin + 1].max() > 3 * echo[wall_bin - 10]


def test_total_echo_of_a_screen_is_the_gain_weighted_view_that_it_fills(make_ground: MakeGround) -> None:
    """A screen all round that fills the beam returns gamma times the beam's two-way solid angle over R squared."""
    distance = 6000.0
    ground = make_ground(lambda x, y: np.where(np.hypot(x, y) > distance, 500.0, -500.0))
    echo = look(ground, 0.0, tilt_deg=0.0)
    sigma = math.radians(3.5) / math.sqrt(16 * math.log(2))
    assert echo.sum() == pytest.approx(2 * math.pi * sigma**2 / distance**2, rel=0.03)


def test_the_horizon_drops_by_the_four_thirds_earth(make_ground: MakeGround) -> None:
    """From 5 m the smooth Earth ends at sqrt(2 k R h), about 9.2 km, and nothing answers from beyond."""
    echo = look(make_ground(lambda x, y: 0 * x + 0 * y), 5.0, tilt_deg=0.0)
    horizon = math.sqrt(2 * 4 / 3 * 6_371_000 * 5.0)
    assert echo[int(horizon / BIN_M) - 3] > 0
    assert not echo[int(horizon / BIN_M) + 2 :].any()


def test_unknown_ground_neither_answers_nor_hides_what_lies_behind(make_ground: MakeGround) -> None:
    hole = make_ground(lambda x, y: np.where((y > 3000) & (y < 5000), math.nan, 0.0) + 0 * x)
    echo = look(hole, 300.0)
    assert not echo[(CENTRES_M > 3150) & (CENTRES_M < 4950)].any()
    assert echo[CENTRES_M > 5200].all()


def test_ground_beyond_the_raster_is_unknown(make_ground: MakeGround) -> None:
    full = make_ground(lambda x, y: 0 * x + 0 * y)
    views = Views(np.zeros(1), np.full(1, 8000.0), np.full(1, 300.0), np.zeros(1))
    echo = mean_echo(full, views, Beam(-2.0, 3.5), RANGE_M, BINS)[0]
    assert echo[CENTRES_M < 3900].any()
    assert not echo[CENTRES_M > 4100].any()


def test_ground_off_the_boresight_is_dimmed_by_the_beam(make_ground: MakeGround) -> None:
    ground = make_ground(lambda x, y: np.where((np.abs(y - 5000) < 20) & (np.abs(x) < 60), 200.0, -500.0))
    bearings = (0.0, 1.75)
    echoes = [look(ground, 100.0, bearing_deg=bearing, tilt_deg=0.0)[195:206].sum() for bearing in bearings]
    assert 10 * math.log10(echoes[1] / echoes[0]) == pytest.approx(-6.0, abs=2.0)
