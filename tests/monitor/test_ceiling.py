"""Ceilings: never below the ground near them, and states with them are those without. Rays that stay in the grid."""

from collections.abc import Sequence
from math import floor, inf, nan, pi, radians, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.ceiling import BLOCK, ceilings, clear_m
from monitor.geodesy import Ray, along
from monitor.prediction import Beam, Pointing, bins_at, predict, stays_inside, tangents
from monitor.terrain import Grid, Terrain, bilinear

BIN_M = 18520 / 512
POST_M = 25.0
FARTHEST_M = 2000.0
BENDS = st.floats(0, 30).flatmap(lambda most: st.tuples(*[st.floats(-most, most)] * 8))


def rough(seed: int, rows: int = 90, columns: int = 70) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(0, 40, (rows, columns)).astype(np.float32)


def bent(row: float, column: float, azimuth_rad: float, posts: Sequence[float] = (0.0,) * 8) -> Ray:
    """A ray in posts that lie `POST_M` apart; the higher powers of either polynomial come to `posts` at the end."""
    down, right = np.reshape(posts, (2, 4)) / FARTHEST_M ** np.arange(2, 6)
    powers = (row, -np.cos(azimuth_rad) / POST_M, *down, column, np.sin(azimuth_rad) / POST_M, *right)
    return Ray._make(powers)


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
    BENDS,
)
def test_all_ground_up_to_the_clear_distance_is_seen_below_the_tangent(
    seed: int,
    row: float,
    column: float,
    azimuth: float,
    height_m: float,
    tangent: float,
    tolerance_m: float,
    posts: tuple[float, ...],
) -> None:
    height = rough(seed)
    height[seed % 90, seed % 70] = nan
    ray = bent(row, column, azimuth, posts)
    distance_m = clear_m(ceilings(height), ray, height_m, tangent, tolerance_m, FARTHEST_M)
    for s in np.arange(0.0, min(distance_m, FARTHEST_M), 5.0):
        ground_m = bilinear(height, *along(ray, s))
        for near in (max(s - tolerance_m, 0.0), s + tolerance_m):
            assert ground_m - height_m < tangent * near or (near == 0.0 and ground_m < height_m)


@given(st.integers(0, 2**32 - 1))
def test_no_peak_below_a_bent_ray_is_passed_over(seed: int) -> None:
    """A ray that goes up to ten times as fast, over ground where every block along it but one is too low to matter."""
    random = np.random.default_rng(seed)
    ray = bent(400.0, 400.0, random.uniform(-4, 4), random.uniform(-75, 75, 8).tolist())
    for peak_m in random.uniform(0, FARTHEST_M, 20):
        row, column = along(ray, peak_m)
        ceiling = np.zeros((198, 198), np.float32)
        i, j = round(row) // BLOCK, round(column) // BLOCK
        ceiling[i - 2 : i + 1, j - 2 : j + 1] = 1000.0  # as that of a post
        assert clear_m(ceiling, ray, 100.0, 0.0, 0.0, FARTHEST_M) <= peak_m


@given(st.floats(-4, 4), st.floats(1.0, FARTHEST_M), BENDS)
def test_no_ray_surely_stays_inside_that_leaves_the_grid_by_a_hair_on_one_side(
    azimuth: float, far_m: float, posts: tuple[float, ...]
) -> None:
    middle = bent(300.0, 300.0, azimuth, posts)
    rows, columns = np.array([along(middle, s) for s in np.linspace(0, far_m, 2000).tolist()]).T
    assert stays_inside(bent(2000.0, 2000.0, azimuth, posts), far_m, (4000, 4000))
    hair = 1e-4
    for down, right in (
        (-rows.min() - hair, 0.0),
        (0.0, -columns.min() - hair),
        (599 - rows.max() + hair, 0.0),
        (0.0, 599 - columns.max() + hair),
    ):
        assert not stays_inside(bent(300 + down, 300 + right, azimuth, posts), far_m, (600, 600))


def test_a_straight_ray_surely_stays_inside_unless_it_ends_within_a_hundredth_of_a_post_of_the_rim() -> None:
    for far_m, stays in ((40.01 * POST_M, False), (39.99 * POST_M, True)):
        for azimuth in (0.0, pi / 2, pi, -pi / 2):
            assert stays_inside(bent(40.0, 40.0, azimuth), far_m, (81, 81)) is stays


def test_the_clear_distance_ends_before_a_wall_and_within_two_windows_of_it() -> None:
    height = np.zeros((200, 60), np.float32)
    height[:80] = 500.0
    distance_m = clear_m(ceilings(height), bent(190.0, 30.0, 0.0), 400.0, -0.05, 3.6, 5000.0)
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
