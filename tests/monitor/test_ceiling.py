"""Ceilings: never below the ground near them, and states with them are those without."""

from math import floor, inf, nan, radians, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.ceiling import BLOCK, ceilings, clear_m
from monitor.geodesy import Ray, along
from monitor.prediction import Beam, Pointing, bins_at, predict, tangents
from monitor.terrain import Grid, Terrain, bilinear

BIN_M = 18520 / 512
POST_M = 25.0


def rough(seed: int, rows: int = 90, columns: int = 70) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(0, 40, (rows, columns)).astype(np.float32)


def straight(row: float, column: float, azimuth_rad: float) -> Ray:
    """A ray in posts that lie `POST_M` apart."""
    return Ray(row, -np.cos(azimuth_rad) / POST_M, 0.0, 0.0, column, np.sin(azimuth_rad) / POST_M, 0.0, 0.0)


def test_a_ceiling_is_the_highest_post_of_nine_blocks_and_none_where_one_is_void() -> None:
    height_m = rough(1)
    height_m[50, 20] = nan
    found = ceilings(height_m)
    assert found.shape == (90 // BLOCK - 2, 70 // BLOCK - 2)
    for i, j in np.ndindex(found.shape):
        around = height_m[i * BLOCK : (i + 3) * BLOCK, j * BLOCK : (j + 3) * BLOCK]
        assert np.array_equal(found[i, j], around.max(), equal_nan=True)
    assert 0 < np.count_nonzero(np.isnan(found)) <= 9


def test_terrain_of_less_than_three_blocks_has_no_ceilings() -> None:
    assert not ceilings(rough(1, rows=3 * BLOCK - 1)).size
    assert ceilings(rough(1, rows=3 * BLOCK)).size


@given(
    st.integers(0, 99),
    st.floats(-5, 95),
    st.floats(-5, 75),
    st.floats(-4, 4),
    st.floats(-50, 600),
    st.floats(-1, 1),
    st.sampled_from([0.0, 3.6, 30.0]),
)
def test_all_ground_up_to_the_clear_distance_is_seen_below_the_tangent(
    seed: int, row: float, column: float, azimuth: float, height_m: float, tangent: float, tolerance_m: float
) -> None:
    height = rough(seed)
    height[seed % 90, seed % 70] = nan
    ray = straight(row, column, azimuth)
    distance_m = clear_m(ceilings(height), ray, height_m, tangent, tolerance_m, 2000.0)
    for s in np.arange(0.0, distance_m, 5.0):
        ground_m = bilinear(height, *along(ray, s))
        for near in (max(s - tolerance_m, 0.0), s + tolerance_m):
            assert ground_m - height_m < tangent * near or (near == 0.0 and ground_m < height_m)


def test_the_clear_distance_ends_before_a_wall_and_within_two_windows_of_it() -> None:
    height = np.zeros((200, 60), np.float32)
    height[:80] = 500.0
    distance_m = clear_m(ceilings(height), straight(190.0, 30.0, 0.0), 400.0, -0.05, 3.6, 5000.0)
    wall_m = (190 - 80) * POST_M
    assert wall_m - 4 * BLOCK * POST_M < distance_m < wall_m


@pytest.mark.parametrize("terrain", ["white_mountains", "sierra"])
@given(
    st.floats(-0.02, 1.02),
    st.floats(-0.02, 1.02),
    st.floats(-50, 4000),
    st.floats(-7, 7),
    st.floats(-16, 16),
    st.sampled_from([9.0, BIN_M, 290.0]),
    st.sampled_from([1, 16, 511, 512]),
    st.sampled_from([1, 7]),
    st.integers(0, 2**32 - 1),
)
def test_states_and_voids_are_those_of_looking_up_every_bin(
    request: pytest.FixtureRequest,
    terrain: str,
    south: float,
    east: float,
    above_m: float,
    azimuth: float,
    tilt_deg: float,
    bin_m: float,
    bins: int,
    fan: int,
    seed: int,
) -> None:
    stored: Terrain = request.getfixturevalue(terrain)
    rows, columns = stored.grid.height_m.shape
    height_m = stored.grid.height_m.copy()
    i, j = np.random.default_rng(seed).integers(0, (rows, columns))
    height_m[i : i + 3, j : j + 3] = nan
    grid = stored.grid._replace(height_m=height_m, ceiling_m=ceilings(height_m))
    latitude = grid.north_deg - south * rows * grid.row_deg
    longitude = grid.west_deg + east * columns * grid.column_deg
    here = bilinear(height_m, floor(south * rows), floor(east * columns))
    height = above_m + (here if np.isfinite(here) else 0.0)
    pointing = Pointing(*(np.array([value]) for value in (latitude, longitude, height, azimuth, radians(tilt_deg))))
    found = predict(grid, pointing, bins, bin_m, Beam(azimuth_fan=fan))
    without = predict(Grid(*grid[:5]), pointing, bins, bin_m, Beam(azimuth_fan=fan))
    np.testing.assert_array_equal(found[0], without[0])
    np.testing.assert_array_equal(found[1], without[1])


def test_near_bins_below_the_beam_are_not_looked_up(white_mountains: Terrain) -> None:
    bins = bins_at((np.arange(512, dtype=np.float64) + 0.5) * BIN_M)
    place = (44.37514, -71.71874, 1500.0, radians(197.6))
    every, some = np.empty(512), np.empty(512)
    tangents(white_mountains.grid, *place, bins, 4 / 3, -inf, every)
    tangents(white_mountains.grid, *place, bins, 4 / 3, tan(radians(-3.75)), some)
    left = np.isneginf(some) & ~np.isneginf(every)
    assert np.count_nonzero(left) > 100
    assert (every[left] < tan(radians(-3.75))).all()
    np.testing.assert_array_equal(some[~left], every[~left])
