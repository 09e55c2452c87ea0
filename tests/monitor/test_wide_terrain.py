"""Terrain that is not held as a whole: everything as if it were, in bounded memory, wherever the aircraft flies."""

import shutil
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Geod, Transformer
from scipy.ndimage import gaussian_filter

from monitor import terrain, terrain_files
from monitor.integrity import Monitor
from monitor.prediction import Beam, Pointing, predict
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import DEM_SHADOW
from monitor.terrain import Terrain, WideTerrain, open_terrain
from monitor.terrain_files import TerrainError
from monitor.warmup import warm_up
from monitor.water import WaterError, open_water
from tests.monitor.scanning import CALIBRATED, flying, moved
from tests.monitor.test_terrain import EAST, NORTH, SPACING, north_up, utm_plane, write
from tests.monitor.test_water import square, written

SOUTH, WEST, SIDE = 43, 7, 4  # tiles of a degree
BINARY, ARC_SECONDS_30 = 128, 120  # posts to a degree: with the first every place in posts is exact
Wide = Callable[..., WideTerrain]


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> Wide:
    """Opens files as if they were too large to be held."""

    def opened(paths: Path | list[Path], kept_posts: int = 100_000) -> WideTerrain:
        with monkeypatch.context() as small:
            small.setattr(terrain, "WHOLE_POSTS", 0)
            found = open_terrain(paths)
        monkeypatch.setattr(terrain, "KEPT_POSTS", kept_posts)
        assert isinstance(found, WideTerrain)
        return found

    return opened


def tiles(directory: Path, posts: int) -> list[Path]:
    """Sixteen tiles with a row or column in common, mountains up to 3 km, and a void across a corner of four."""
    size = SIDE * posts + 1
    rough = gaussian_filter(np.random.default_rng(5).standard_normal((size, size)), 3)
    height_m = ((rough - rough.min()) / np.ptp(rough) * 3000).astype(np.int16)
    height_m[posts - 3 : posts + 4, posts - 5 : posts + 2] = -9999
    paths = []
    for row in range(SIDE):
        for column in range(SIDE):
            part = height_m[row * posts : (row + 1) * posts + 1, column * posts : (column + 1) * posts + 1]
            west, north, half = WEST + column, SOUTH + SIDE - row, 0.5 / posts
            path = directory / f"{row}{column}.tif"
            paths.append(write(path, part, north_up(west - half, north + half, 1 / posts), nodata=-9999))
    return paths


@pytest.fixture(scope="module")
def binary(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return tiles(tmp_path_factory.mktemp("binary"), BINARY)


def places(seed: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    return rng.uniform(SOUTH - 0.1, SOUTH + SIDE + 0.1, count), rng.uniform(WEST - 0.1, WEST + SIDE + 0.1, count)


def test_elevations_are_those_of_the_whole_on_the_borders_of_tiles_andpieces_too(
    binary: list[Path], wide: Wide
) -> None:
    on_borders = np.meshgrid(SOUTH + np.arange(SIDE * 8 + 1) / 8, WEST + np.arange(SIDE * 8 + 1) / 8)
    nowhere = np.array([np.nan, np.inf, 44.0, -1e300])
    latitude, longitude = (
        np.concatenate([at, some.ravel(), none])
        for at, some, none in zip(places(1, 5000), on_borders, (nowhere, nowhere[::-1]), strict=True)
    )
    expected = open_terrain(binary).elevation(latitude, longitude)
    assert 400 < np.isnan(expected).sum() < 1000
    np.testing.assert_array_equal(wide(binary).elevation(latitude, longitude), expected)
    assert np.isfinite(wide(binary).elevation(SOUTH + SIDE, WEST)), "a corner"


def test_posts_30_arc_seconds_apart_give_the_heights_of_the_whole_to_a_rounding(tmp_path: Path, wide: Wide) -> None:
    """A place in posts is rounded to 6e-14, and posts side by side differ by less than 3 km."""
    paths = tiles(tmp_path, ARC_SECONDS_30)
    at = places(2, 5000)
    np.testing.assert_allclose(wide(paths).elevation(*at), open_terrain(paths).elevation(*at), rtol=0, atol=1e-8)


@pytest.mark.parametrize("posts", [BINARY, ARC_SECONDS_30])
def test_a_flight_across_all_tiles_sees_the_shadows_of_the_whole_in_bounded_memory(
    tmp_path: Path, wide: Wide, posts: int
) -> None:
    paths, kept = tiles(tmp_path, posts), 90_000
    whole, pieces = open_terrain(paths), wide(paths, kept)
    reach_m, bins = 40 * 1852.0, 512
    lost, shadowed, read, before = 0, 0, 0, None
    for share in np.linspace(0.02, 0.98, 60):
        ones = np.ones(36)
        here = (SOUTH + share * SIDE) * ones, (WEST + share * SIDE) * ones
        pointing = Pointing(*here, 3500 * ones, np.radians(np.arange(36) * 10.0), np.radians(-1) * ones)
        piece = pieces.around(here[0], here[1], reach_m)
        assert pieces.held_posts <= kept
        assert pieces.around(here[0], here[1], reach_m) is piece
        read, before = read + int(piece is not before), piece
        expected, void = predict(whole.grid, pointing, bins, reach_m / bins, Beam())
        states, left = predict(piece.grid, pointing, bins, reach_m / bins, Beam())
        np.testing.assert_array_equal(states, expected)
        np.testing.assert_array_equal(left, void)
        lost += int(np.count_nonzero(void))
        shadowed += int(np.count_nonzero(expected[~void] == DEM_SHADOW))
    assert 8 < read < 40
    assert lost > 300, "at both ends, and over the void"
    assert shadowed > 10_000
    assert kept < whole.grid.height_m.size / 2


def test_a_piece_reaches_as_far_as_a_radial_in_any_direction(binary: list[Path], wide: Wide) -> None:
    """pyproj says where the ends of radials lie."""
    latitude, longitude, reach_m = np.array([44.49, 44.51]), np.array([8.9, 8.91]), 60_000.0
    extent = wide(binary).around(latitude, longitude, reach_m).extent
    azimuth = np.arange(360.0)
    for lat, lon in zip(latitude, longitude, strict=True):
        ends = Geod(ellps="WGS84").fwd(np.full(360, lon), np.full(360, lat), azimuth, np.full(360, reach_m))
        assert extent.west <= min(ends[0])
        assert max(ends[0]) <= extent.east
        assert extent.south <= min(ends[1])
        assert max(ends[1]) <= extent.north


def test_which_piece_it_is_depends_on_the_places_alone(binary: list[Path], wide: Wide) -> None:
    fresh, flown = wide(binary), wide(binary)
    for latitude in np.arange(43.2, 46.8, 0.1):
        flown.around(np.array(latitude), np.array(8.0), 30_000.0)
    one, other = (some.around(np.array([45.1]), np.array([9.2]), 30_000.0).grid for some in (fresh, flown))
    assert one[1:5] == other[1:5]
    np.testing.assert_array_equal(one.height_m, other.height_m)
    near = fresh.around(np.array([45.12, 45.08]), np.array([9.21, 9.19]), 30_000.0)
    assert near.grid is one, "the same blocks are one piece"


def test_opening_reads_headers_and_a_file_is_told_where_its_heights_are_needed(
    binary: list[Path], tmp_path: Path, wide: Wide
) -> None:
    torn, lost = (Path(shutil.copy(path, tmp_path)) for path in binary[:2])
    torn.write_bytes(torn.read_bytes()[:20_000])
    found = wide([torn, lost, *binary[2:]])
    lost.unlink()
    assert np.isfinite(found.elevation(44.6, 9.6))
    with pytest.raises(TerrainError, match=r"00\.tif cannot be read"):
        found.elevation(46.1, 7.5)
    with pytest.raises(TerrainError, match=r"01\.tif does not exist"):
        found.elevation(46.6, 8.6)
    shutil.copy(binary[1], lost)
    assert found.elevation(46.6, 8.6) == open_terrain(binary[1]).elevation(46.6, 8.6)
    write(lost, np.zeros((5, 5), np.int16), north_up(8, 47, 0.25))
    with pytest.raises(TerrainError, match=r"01\.tif has other posts than when it was opened"):
        found.elevation(46.1, 8.7)


def test_heights_that_no_ground_has_are_told_where_they_are_needed(tmp_path: Path, wide: Wide) -> None:
    heights = np.full((9, 9), 100, np.int16)
    heights[1, 1] = 30_000
    found = wide(write(tmp_path / "noise.tif", heights, north_up(7 - 1 / 8, 45 + 1 / 8, 0.25)))
    assert found.elevation(43.25, 8.75) == 100
    with pytest.raises(TerrainError, match=r"noise\.tif holds heights of 100 to 30000 m: mark voids"):
        found.elevation(44.75, 7.25)


def test_a_projected_file_is_warped_inpieces(tmp_path: Path, wide: Wide, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one that is warped as a whole: GDAL places pixels to an eighth."""
    monkeypatch.setattr(terrain, "BLOCK_DEG", 0.03125)
    found = wide(utm_plane(tmp_path / "utm.tif"), kept_posts=40_000)
    east, north = np.random.default_rng(2).uniform(100, 11_900, (2, 500))
    lon, lat = Transformer.from_crs("EPSG:32619", "EPSG:4326", always_xy=True).transform(EAST + east, NORTH - north)
    expected = 500 + 0.05 * east + 0.03 * north
    np.testing.assert_allclose(found.elevation(lat, lon), expected, atol=0.125 * SPACING * np.hypot(0.05, 0.03))
    assert len(found.pieces) > 1


def test_a_file_that_is_read_by_strips_is_the_same(binary: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    at_once = open_terrain(binary).grid.height_m
    monkeypatch.setattr(terrain_files, "POSTS_AT_ONCE", 1000)
    np.testing.assert_array_equal(open_terrain(binary).grid.height_m, at_once)


def test_the_checksum_of_wide_terrain_is_of_sizes_and_a_block_of_each_mib(tmp_path: Path, wide: Wide) -> None:
    path = write(
        tmp_path / "a.tif", np.arange(900_000, dtype=np.int16).reshape(900, 1000) % 3000, north_up(7, 45, 1e-3)
    )
    content = path.read_bytes()
    assert 1 << 20 < len(content) < 2 << 20
    blocks = content[:4096] + content[1 << 20 : (1 << 20) + 4096]
    expected = zlib.crc32(len(content).to_bytes(8, "little") + blocks)
    assert wide(path).checksum == f"{expected:08x}"
    assert open_terrain(path).checksum == f"{zlib.crc32(content):08x}"


SETTINGS = MonitorSettings(tracked_scans=2)


def test_a_monitor_overpieces_judges_as_one_over_the_whole(
    white_mountains: Terrain,
    white_mountains_path: Path,
    honest: Scan,
    tmp_path: Path,
    wide: Wide,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An alert with its offset search, tracked shadows and water, and an aircraft outside the files."""
    monkeypatch.setattr(terrain, "BLOCK_DEG", 0.125)
    found = wide(white_mountains_path, 10**6)
    lake = written(tmp_path / "lake.geojson", square(-72.1, 43.9, -71.8, 45.1))
    verdicts: dict[Terrain, list[object]] = {white_mountains: [], found: []}
    for stored, said in verdicts.items():
        water = open_water(lake, stored, 1.0)
        for monitor in (
            Monitor(stored, None, CALIBRATED, water),
            Monitor(stored, SETTINGS, CALIBRATED),
            Monitor(stored, MonitorSettings(offset_search_m=400), CALIBRATED),
        ):
            for scan in (honest, replace(honest, time_ns=honest.time_ns + 1), moved(honest, 9)):
                said.append(monitor.judge(scan, flying())[0])
        said.append(Monitor(stored, None, CALIBRATED).judge(honest, flying(latitude_deg=46.0))[0])
    assert verdicts[found] == verdicts[white_mountains]
    kinds = [verdict.verdict for verdict in verdicts[found]]  # type: ignore[attr-defined]
    assert {"ok", "alert", "unavailable"} == set(kinds)
    assert found.held_posts < white_mountains.grid.height_m.size


def test_a_file_that_is_lost_in_flight_makes_a_verdict_and_ends_nothing(
    white_mountains_path: Path, honest: Scan, tmp_path: Path, wide: Wide
) -> None:
    path = Path(shutil.copy(white_mountains_path, tmp_path / "N44W072.hgt"))
    water = written(tmp_path / "lake.geojson", square(-71.3, 44.1, -71.2, 44.2))
    found = wide(path)
    monitor = Monitor(found, None, CALIBRATED, open_water(water, found, 1.0))
    path.unlink()
    verdict, comparison = monitor.judge(honest, flying())
    assert (verdict.verdict, comparison) == ("unavailable", None)
    assert "N44W072.hgt does not exist" in verdict.reasons[0]
    shutil.copy(white_mountains_path, path)
    assert monitor.judge(honest, flying())[0].verdict == "ok"


def test_a_monitor_is_warmed_up_without_the_terrain_s_files(
    white_mountains_path: Path, tmp_path: Path, wide: Wide
) -> None:
    path = Path(shutil.copy(white_mountains_path, tmp_path / "N44W072.hgt"))
    found = wide(path)
    path.unlink()
    warm_up(Monitor(found))
    assert found.held_posts == 0


def test_water_is_drawn_on_a_piece_as_on_the_whole_and_goes_with_it(
    binary: list[Path], tmp_path: Path, wide: Wide
) -> None:
    raster = write(tmp_path / "sea.tif", np.ones((300, 200), np.uint8), north_up(9.1041, 45.3041, 1 / BINARY))
    lake = written(tmp_path / "lake.geojson", square(7.3041, 44.2041, 8.9041, 44.9041))
    whole, pieces = open_terrain(binary), wide(binary, 60_000)
    wet, water = open_water([raster, lake], whole, 1.0).on(whole).wet, open_water([raster, lake], pieces, 1.0)
    seen = 0
    for latitude in np.arange(43.3, 46.8, 0.25):
        piece = pieces.around(np.array(latitude), np.array(9.0), 40_000.0)
        top = round((whole.grid.north_deg - piece.grid.north_deg) * BINARY)
        left = round((piece.grid.west_deg - whole.grid.west_deg) * BINARY)
        rows, columns = piece.grid.height_m.shape
        np.testing.assert_array_equal(water.on(piece).wet, wet[top : top + rows, left : left + columns])
        assert water.on(piece) is water.on(piece)
        seen += water.on(piece).wet.sum()
    assert seen > 10_000
    del piece
    assert len(water._drawn) == len(pieces.pieces) < 5


def test_water_away_from_wide_terrain_is_refused_and_a_lost_file_is_told_when_it_is_drawn(
    binary: list[Path], tmp_path: Path, wide: Wide
) -> None:
    pieces = wide(binary)
    with pytest.raises(WaterError, match=r"far\.geojson lies outside the terrain"):
        open_water(written(tmp_path / "far.geojson", square(17, 45, 18, 46)), pieces, 1.0)
    raster = write(tmp_path / "sea.tif", np.ones((30, 30), np.uint8), north_up(9.1, 45.3, 1 / BINARY))
    water = open_water(raster, pieces, 1.0)
    raster.unlink()
    with pytest.raises(WaterError, match=r"sea\.tif cannot be read"):
        water.on(pieces.around(np.array(45.0), np.array(9.0), 10_000.0))
