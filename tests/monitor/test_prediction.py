"""The terrain thread's geometry: against a dense walk over real ground, and on made-up ground by triangles."""

from math import inf, radians, tan

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Geod, Transformer

from monitor.geodesy import along, curvature_radii, ray
from monitor.prediction import Beam, Pointing, bins_at, predict, tangents
from monitor.shade import dem_states, shadows
from monitor.terrain import Grid, Terrain
from tests.monitor.ground import COLUMNS, LATITUDE, LONGITUDE, distance_m, looking_north, mesa, northward, plain, post_m

FLAT = Beam(azimuth_fan=1, refraction_k=inf)
BIN_M = 18520 / 512
SINGLE = 2.0**-23  # the tangents are of single precision, and two roundings from the exact ones
STEEPEST_DEG = 30.0  # a tilt of -16 degrees, the lowest that ARINC 708 can say, and half of the widest beam


def look(grid: Grid, height_m: float, ranges_m: NDArray[np.float64], k: float) -> NDArray[np.float64]:
    delta = np.empty(ranges_m.size)
    assert not tangents(grid, LATITUDE, LONGITUDE, height_m, 0.0, bins_at(ranges_m), k, -inf, delta)
    return delta


def dense_walk(terrain: Terrain, place: tuple[float, float, float], azimuth: float) -> NDArray[np.float64]:
    """Range and elevation (2, n) of the ground at every metre along a geodesic, through Earth-centred coordinates."""
    latitude, longitude, height_m = place
    s = np.arange(1.0, 18_600.0)
    start = (np.full(s.size, longitude), np.full(s.size, latitude), np.full(s.size, azimuth))
    lon, lat, _ = Geod(ellps="WGS84").fwd(*start, s)
    to_earth = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    ground = np.array(to_earth.transform(lon, lat, terrain.elevation(lat, lon)))
    line = ground - np.array(to_earth.transform(longitude, latitude, height_m))[:, None]
    phi, lam = radians(latitude), radians(longitude)
    up = np.array([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)])
    ranges = np.linalg.norm(line, axis=0)
    return np.array([ranges, np.arcsin(up @ line / ranges)])


@pytest.mark.parametrize("azimuth", [20, 110, 197.6, 290])
@pytest.mark.parametrize("place", [(44.37514, -71.71874, 761.0), (44.3, -71.5, 2000.0), (44.3, -71.45, 3500.0)])
def test_real_ground_is_met_to_a_tenth_of_a_range_bin(
    white_mountains: Terrain, place: tuple[float, float, float], azimuth: float
) -> None:
    """Where only one piece of ground has a bin's slant range, the bin's point lies on the walked ground.

    A bin's point has its slant range and the elevation that `tangents` found; no curvature but the ellipsoid's (k = 1).
    """
    ranges, elevation = dense_walk(white_mountains, place, azimuth)
    bin_ranges = (np.arange(512, dtype=np.float64) + 0.5) * BIN_M
    delta = np.empty(512)
    assert not tangents(white_mountains.grid, *place, radians(azimuth), bins_at(bin_ranges), 1.0, -inf, delta)
    farther_before = np.maximum.accumulate(ranges)
    nearer_after = np.minimum.accumulate(ranges[::-1])[::-1]
    ground = ranges * np.exp(1j * elevation)
    tested = 0
    for r, tangent in zip(bin_ranges, delta, strict=True):
        first, last = np.searchsorted(farther_before, r), np.searchsorted(nearer_after, r)
        if 0 < first == last < ranges.size and elevation[first] > -radians(STEEPEST_DEG):
            near = slice(max(0, first - 10), first + 10)
            assert np.abs(ground[near] - r * np.exp(1j * np.arctan(tangent))).min() < BIN_M / 10
            tested += 1
    assert tested > 300


@pytest.mark.parametrize("azimuth", [20, 197.6, 290])
@pytest.mark.parametrize(
    ("terrain", "place", "bin_m"),
    [
        ("white_mountains", (44.37514, -71.71874, 761.0), BIN_M),
        ("white_mountains", (44.3, -71.45, 3500.0), BIN_M),
        ("white_mountains", (44.3, -71.5, 9000.0), BIN_M),
        ("sierra", (37.43, -119.26, 2800.0), BIN_M / 2),
        ("sierra", (37.43, -119.26, 6000.0), BIN_M / 2),
    ],
)
def test_every_bin_lies_on_the_ground_however_steeply_the_beam_looks(
    request: pytest.FixtureRequest, terrain: str, place: tuple[float, float, float], bin_m: float, azimuth: float
) -> None:
    """Not only where the slant range has one solution: each bin has its range and lies on the walked ground."""
    stored: Terrain = request.getfixturevalue(terrain)
    below_m = place[2] - float(stored.elevation(*place[:2]))
    bin_ranges = (np.arange(512, dtype=np.float64) + 0.5) * bin_m
    ranges, elevation = dense_walk(stored, place, azimuth)
    delta = np.empty(512)
    tangents(stored.grid, *place, radians(azimuth), bins_at(bin_ranges), 1.0, -inf, delta)
    np.testing.assert_array_equal(np.isneginf(delta), bin_ranges <= below_m)
    within = (bin_ranges > below_m) & (bin_ranges < np.nanmax(ranges) - bin_m) & ~np.isnan(delta)
    assert np.count_nonzero(within) > 150
    ground = ranges * np.exp(1j * elevation)
    points = bin_ranges[within] * np.exp(1j * np.arctan(delta[within]))
    misses = [np.nanmin(np.abs(ground - point)) for point in points]
    assert max(misses) < bin_m / 10


def two_corrections(
    terrain: Terrain, pointing: Pointing, bin_m: float, k: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Tangents (n, 512) of radials, bin after bin, each corrected twice from the ground of the one before."""
    rays = [
        ray(latitude, longitude, (height_m + float(terrain.elevation(latitude, longitude))) / 2, azimuth)
        for latitude, longitude, height_m, azimuth in zip(*pointing[:4], strict=True)
    ]
    meridian, prime = curvature_radii(radians(float(pointing.latitude_deg[0])))
    ground = terrain.elevation(*pointing[:2])
    delta = np.empty((len(rays), 512))
    for j in range(512):
        r2 = ((j + 0.5) * bin_m) ** 2
        for _ in range(2):
            s = np.sqrt(r2 - (pointing.height_m - ground) ** 2)
            places = np.array([along(*each) for each in zip(rays, s, strict=True)])
            found = terrain.elevation(*places.T)
            ground = np.where(s > 0, found, ground)
        s = np.sqrt(r2 - (pointing.height_m - ground) ** 2)
        delta[:, j] = np.where(s > 0, -(pointing.height_m - ground) / s - s / (2 * k * np.sqrt(meridian * prime)), -inf)
    return delta, np.isnan(ground)


@pytest.mark.filterwarnings("ignore:invalid value encountered in sqrt")
@pytest.mark.parametrize(
    ("terrain", "place", "bin_m"),
    [("white_mountains", (44.37514, -71.71874, 761.0), BIN_M), ("sierra", (37.43, -119.26, 2500.0), BIN_M / 2)],
)
def test_states_are_those_of_bins_corrected_twice_one_after_the_other_but_for_one_in_a_thousand(
    request: pytest.FixtureRequest, terrain: str, place: tuple[float, float, float], bin_m: float
) -> None:
    """What a tenth of a bin decides: a bin at an edge, or whether a lit one is a peak."""
    stored: Terrain = request.getfixturevalue(terrain)
    n = 60
    latitude, longitude, height_m = np.repeat(place, n).reshape(3, n)
    pointing = Pointing(latitude, longitude, height_m, np.radians(np.arange(n) * 6.0), np.radians(np.full(n, -2.0)))
    states, void = predict(stored.grid, pointing, 512, bin_m, Beam(azimuth_fan=1))
    delta, lost = two_corrections(stored, pointing, bin_m, 4 / 3)
    np.testing.assert_array_equal(void, lost)
    expected = dem_states(delta[~lost], tan(radians(-3.75)), tan(radians(-0.25)))
    assert np.count_nonzero(expected > 0) > 2000
    assert np.count_nonzero(states[~lost] != expected) < expected.size / 1000


def test_a_bin_is_found_though_its_first_guess_lies_beyond_the_last_post() -> None:
    """From 500 m, 100 m over a plateau, the ground of 10 km is looked for at 9999.5 m; on the plain it is at 9987.5."""
    edge_m = post_m(323)
    grid = northward(lambda latitude: np.where(distance_m(latitude) < 2000, 400.0, 0.0), rows=10 + 324)
    guess_m, ground_m = edge_m + 2, edge_m - 10
    range_m = float(np.hypot(guess_m, 100))
    assert np.sqrt(range_m**2 - 500**2) == pytest.approx(ground_m, abs=1)
    delta = np.empty(1)
    assert not tangents(grid, LATITUDE, LONGITUDE, 500.0, 0.0, bins_at(np.array([range_m])), inf, -inf, delta)
    assert delta[0] == pytest.approx(-500 / np.sqrt(range_m**2 - 500**2), rel=SINGLE)
    assert tangents(grid, LATITUDE, LONGITUDE, 500.0, 0.0, bins_at(np.array([range_m + 15])), inf, -inf, delta)


def test_the_drop_at_10_nautical_miles_is_20_metres_with_standard_refraction() -> None:
    """s^2 / (2 k R): 18520^2 / (2 x 4/3 x 6371 km) is 20.2 m, without refraction 26.9 m."""
    s = 18_520.0
    level = look(plain(), 0.0, np.array([s]), inf)
    for k, drop_m in ((4 / 3, 20.2), (1.0, 26.9)):
        assert round(float((level - look(plain(), 0.0, np.array([s]), k))[0]) * s, 1) == pytest.approx(drop_m, abs=0.1)


def test_slant_ranges_over_a_plain_give_the_tangent_of_a_right_angled_triangle() -> None:
    ranges_m = np.array([500.0, 1300.0, 5000.0, 13_000.0])
    expected = -500 / np.sqrt(ranges_m[1:] ** 2 - 500**2)  # 1300 : 500 : 1200
    assert expected[0] == pytest.approx(-5 / 12)
    np.testing.assert_allclose(look(plain(), 500.0, ranges_m[1:], inf), expected, rtol=SINGLE)


def test_bins_nearer_than_the_ground_below_stay_dark() -> None:
    delta = look(plain(), 500.0, np.array([100.0, 499.0, 500.0, 501.0]), inf)
    assert np.isneginf(delta).tolist() == [True, True, True, False]
    states, void = predict(plain(), looking_north(500.0, -16.0), 512, BIN_M, FLAT)
    assert not void.any()
    assert (states[0, : int(500 / BIN_M)] == -3).all()


@pytest.mark.parametrize(("height_m", "tilt_deg"), [(300.0, -2.0), (500.0, -3.0), (900.0, -6.0)])
def test_a_plain_is_lit_from_where_the_beam_meets_it_to_where_the_beam_ends(height_m: float, tilt_deg: float) -> None:
    """R = h / tan(gamma - theta_B / 2), eq. (14), is horizontal; bins are slant, and a bin counts by its centre."""
    edges = [abs(height_m / tan(radians(tilt_deg + side * 3.5 / 2))) for side in (-1, 1)]
    nearest, farthest = np.hypot(edges, height_m)
    centres = (np.arange(512) + 0.5) * BIN_M
    states, _ = predict(plain(), looking_north(height_m, tilt_deg), 512, BIN_M, FLAT)
    np.testing.assert_array_equal(states[0] > 0, (centres > nearest) & (centres <= farthest))
    assert 50 < np.count_nonzero(states[0] > 0) < 450


def test_the_far_edge_of_a_bin_can_stand_for_its_range_as_the_paper_writes() -> None:
    """The plain begins in the last third of bin 212: before its far edge, behind its centre."""
    slant = np.hypot(501 / tan(radians(3.75)), 501)
    assert 211.6 < slant / BIN_M < 211.9
    for reference, first in (("far_edge", 212), ("centre", 213)):
        beam = FLAT._replace(range_reference=reference)
        states, _ = predict(plain(), looking_north(501.0, -2.0), 512, BIN_M, beam)
        assert int(np.argmax(states[0] > 0)) + 1 == first


def test_distances_are_horizontal_at_the_height_between_antenna_and_ground() -> None:
    """From 4100 m over a plateau of 4000 m, 15 km of the ellipsoid are 10 m more: where a slope begins tells."""
    begin_m = post_m(500)
    grid = northward(lambda latitude: 4000 + np.clip(distance_m(latitude) - begin_m, 0, 1000))
    ranges_m = np.arange(15_000.0, 16_000.0, 1.0)
    above_plateau = look(grid, 4100.0, ranges_m, inf) * np.sqrt(ranges_m**2 - 100**2) + 100
    start = ranges_m[np.argmax(above_plateau > 0.5)]
    meridian_radius_m = 6_367_400.0  # at 44 degrees
    assert start == pytest.approx(np.hypot(begin_m * (1 + 4050 / meridian_radius_m), 100), abs=2)


@pytest.mark.parametrize("height_m", [600.0, 800.0])
def test_a_wall_casts_the_shadow_of_similar_triangles(height_m: float) -> None:
    """A shadow behind a wall of height H at distance d ends at d h / (h - H); range bins of 10 m."""
    top_m, bin_m, edge_m = 400.0, 10.0, post_m(145)
    states, _ = predict(mesa(post_m(130), edge_m, top_m), looking_north(height_m, -4.0), 1400, bin_m, FLAT)
    (shadow,) = shadows(states, "dem", min_size=3)
    front_m = np.sqrt(((shadow["front"] - 0.5) * bin_m) ** 2 - (height_m - top_m) ** 2)
    back_m = np.sqrt(((shadow["back"] - 0.5) * bin_m) ** 2 - height_m**2)
    assert 4400 < edge_m - bin_m < front_m < edge_m + 2
    ends_m = front_m * height_m / (height_m - top_m)
    assert ends_m < back_m < ends_m + 1.1 * bin_m  # the slant of a bin is the longer side of its triangle


def test_what_stands_above_the_beam_darkens_everything_behind_it() -> None:
    """The plain 100 m below enters the level beam at 3273 m; a slope of 45 degrees from 4000 m leaves it at 4230 m."""
    states, _ = predict(mesa(4900.0, 5400.0, 900.0), looking_north(100.0), 512, BIN_M, FLAT)
    centres = (np.arange(512) + 0.5) * BIN_M
    assert (states[0, (centres > 3275) & (centres < 4200)] > 0).all()
    assert (states[0, centres > 4260] == 0).all()


def peak_beside(east_columns: slice) -> Grid:
    """A wall at 10 km in some columns only; a column is 22 m wide, the beam of 3.5 degrees 611 m there."""
    grid = plain()
    wall = mesa(9_900.0, 10_000.0, 300.0).height_m
    grid.height_m[:, east_columns] = wall[:, east_columns]
    return grid


def test_a_single_sub_azimuth_is_the_boresight_and_sees_nothing_beside_it() -> None:
    middle = COLUMNS // 2
    pointing = looking_north(500.0, -2.0)
    level, _ = predict(plain(), pointing, 512, BIN_M, FLAT)
    beside, _ = predict(peak_beside(slice(middle + 8, None)), pointing, 512, BIN_M, FLAT)
    ahead, _ = predict(peak_beside(slice(middle - 2, middle + 3)), pointing, 512, BIN_M, FLAT)
    assert len(shadows(ahead, "dem")) == 1
    np.testing.assert_array_equal(beside, level)


def test_a_bin_is_lit_if_any_sub_azimuth_of_the_beam_lights_it() -> None:
    """A wall 110 m wide on the boresight, or on one side, hides from some rays what others of the fan still see."""
    middle = COLUMNS // 2
    fan = FLAT._replace(azimuth_fan=7)
    pointing = looking_north(500.0, -2.0)
    for columns in (slice(middle - 2, middle + 3), slice(middle), slice(middle + 1, None)):
        narrow, _ = predict(peak_beside(columns), pointing, 512, BIN_M, fan)
        assert not len(shadows(narrow, "dem"))
    wide, _ = predict(peak_beside(slice(0, None)), pointing, 512, BIN_M, fan)
    assert len(shadows(wide, "dem")) == 1


@pytest.mark.parametrize("columns", [slice(COLUMNS // 2 - 5), slice(COLUMNS // 2 + 6, None)])
def test_a_void_on_either_side_of_the_beam_rejects_the_radial(columns: slice) -> None:
    grid = plain()
    grid.height_m[800:, columns] = np.nan  # everything to one side, from 130 m off the boresight on
    for fan, rejected in ((1, False), (7, True)):
        _, void = predict(grid, looking_north(500.0), 300, BIN_M, FLAT._replace(azimuth_fan=fan))
        assert void.tolist() == [rejected]


def test_a_void_post_on_the_way_rejects_the_radial() -> None:
    grid = plain()
    grid.height_m[600] = np.nan
    pointing = Pointing(*(np.repeat(column, 2) for column in looking_north(500.0)))
    pointing.azimuth_rad[1] = np.pi / 2
    _, void = predict(grid, pointing, 30, BIN_M, FLAT)
    assert not void.any()
    _, void = predict(grid, pointing._replace(azimuth_rad=np.zeros(2)), 512, BIN_M, FLAT)
    assert void.all()


@pytest.mark.parametrize("height_m", [500.0, 3000.0])
def test_a_single_row_of_voids_rejects_the_radial_wherever_it_lies(height_m: float) -> None:
    beneath_m = height_m / np.tan(radians(STEEPEST_DEG))
    for row in range(600, int(1185 - beneath_m / 30)):
        grid = plain()
        grid.height_m[row] = np.nan
        _, void = predict(grid, looking_north(height_m), 512, BIN_M, FLAT)
        assert void.tolist() == [True], row


def test_a_radial_that_leaves_the_terrain_is_rejected_and_its_neighbour_is_not() -> None:
    short = northward(lambda latitude: np.zeros(latitude.size), rows=400)
    both = Pointing(*(np.repeat(column, 2) for column in looking_north(500.0)))
    both.azimuth_rad[1] = np.pi  # southward the terrain ends after 310 m, below the aircraft
    _, void = predict(short, both, 300, BIN_M, FLAT)
    assert void.tolist() == [False, True]
    _, void = predict(short, both, 512, BIN_M, FLAT)
    assert void.tolist() == [True, True]
