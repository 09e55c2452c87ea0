"""The date line is a meridian like any other: the same ground gives the same answers at 10 degrees and at 180."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Transformer
from rasterio.shutil import copy
from scipy.ndimage import gaussian_filter

from gateway.calibrate import dem
from monitor.aircraft import Aircraft
from monitor.integrity import Monitor
from monitor.monte_carlo import Variables, simulate
from monitor.monte_carlo import around as reached
from monitor.prediction import Beam, Pointing, predict
from monitor.scans import Scan
from monitor.settings import LeverArm, MonitorSettings
from monitor.shade import DEM_SHADOW
from monitor.terrain import Terrain, open_terrain
from monitor.verdict import Verdict
from monitor.warmup import warm_up
from monitor.water import WaterError, WaterFiles, open_water
from tests.monitor.conftest import Opened
from tests.monitor.ground import either_side
from tests.monitor.scanning import CALIBRATED, MS, flying, honest_scan, moved
from tests.monitor.test_terrain import north_up, write
from tests.monitor.test_water import raster, square, written

SOUTH, POSTS = -17, 512  # of both tiles; with so many posts to a degree every place in posts is exact
INLAND, LINE = 10, 180  # the meridian between two tiles
LATITUDE, HEIGHT_M = -16.5, 2600.0
Floats = NDArray[np.float64]


def mountains(posts: int) -> NDArray[np.int16]:
    """Two degrees from west to east, one from north to south, up to 3 km."""
    rough = gaussian_filter(np.random.default_rng(3).standard_normal((posts + 1, 2 * posts + 1)), 3)
    return np.asarray((rough - rough.min()) / np.ptp(rough) * 3000, np.int16)


def tiles(directory: Path, meridian: int, posts: int = POSTS) -> list[Path]:
    """West and east of a meridian, a column in common; each between -180 and 180 as its publisher has it."""
    heights, half = mountains(posts), 0.5 / posts
    directory.mkdir(exist_ok=True)
    return [
        write(
            directory / f"{side}.tif",
            heights[:, side * posts : (side + 1) * posts + 1],
            north_up((meridian - 1 + side + 180) % 360 - 180 - half, SOUTH + 1 + half, 1 / posts),
        )
        for side in (0, 1)
    ]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[int, list[Path]]:
    made = tmp_path_factory.mktemp("tiles")
    return {meridian: tiles(made / str(meridian), meridian) for meridian in (INLAND, LINE)}


def places(count: int = 4000) -> tuple[Floats, Floats]:
    """Latitudes over the tiles and a little beyond, and how far east of the meridian: whole posts and others."""
    rng = np.random.default_rng(4)
    south, east = rng.uniform(-0.02, 1.02, count), rng.uniform(-1.02, 1.02, count)
    east[: count // 4] = np.round(east[: count // 4] * POSTS) / POSTS
    east[:50] = 0.0
    return SOUTH + np.round(south * 2**20) / 2**20, np.round(east * 2**20) / 2**20


@pytest.mark.parametrize("east_first", [False, True])
def test_tiles_on_both_sides_are_one_mosaic_that_takes_longitudes_of_either(
    files: dict[int, list[Path]], opened: Opened, east_first: bool
) -> None:
    latitude, east = places()
    expected = open_terrain(files[INLAND]).elevation(latitude, INLAND + east)
    assert 100 < np.isnan(expected).sum() < 1000
    found = opened(files[LINE][::-1] if east_first else files[LINE])
    assert found.extent == (SOUTH, SOUTH + 1, 179, 181)
    for longitude in either_side(LINE + east):
        np.testing.assert_array_equal(found.elevation(latitude, longitude), expected)


@pytest.mark.parametrize("west", [179, -181])
def test_one_file_across_the_line_is_the_same_ground(
    files: dict[int, list[Path]], tmp_path: Path, opened: Opened, west: int
) -> None:
    half = 0.5 / POSTS
    path = write(tmp_path / "both.tif", mountains(POSTS), north_up(west - half, SOUTH + 1 + half, 1 / POSTS))
    latitude, east = places()
    expected = open_terrain(files[INLAND]).elevation(latitude, INLAND + east)
    for longitude in either_side(LINE + east):
        np.testing.assert_array_equal(opened(path).elevation(latitude, longitude), expected)


@pytest.mark.parametrize("kind", ["hgt", "dt1"])
def test_cells_of_srtm_and_dted_lie_side_by_side(tmp_path: Path, kind: str) -> None:
    """Posts of S17E179 and S17W180 at 1200 to a degree, where their standards have them."""
    heights, paths = mountains(1200), []
    for path, name in zip(tiles(tmp_path, LINE, 1200), ("S17E179", "S17W180"), strict=True):
        paths.append(tmp_path / f"{name}.{kind}")
        copy(path, paths[-1], driver={"hgt": "SRTMHGT", "dt1": "DTED"}[kind])
    rng = np.random.default_rng(5)
    i, j = rng.integers(0, 1201, 500), np.r_[1200, 0, 2400, rng.integers(0, 2401, 497)]
    for longitude in either_side(179 + j / 1200):
        found = open_terrain(paths).elevation(SOUTH + 1 - i / 1200, longitude)
        np.testing.assert_allclose(found[2:], heights[i, j][2:], atol=1e-5)


@pytest.mark.parametrize("east_deg", [-0.25, -(2.0**-12), 0.0, 2.0**-12, 0.25])
def test_the_thread_predicts_the_same_states(files: dict[int, list[Path]], opened: Opened, east_deg: float) -> None:
    ones = np.ones(72)
    found = []
    for meridian in (INLAND, LINE):
        stored = opened(files[meridian])
        for longitude in either_side((meridian + east_deg) * ones):
            azimuths = np.radians(np.arange(72) * 5.0)
            at = Pointing(LATITUDE * ones, longitude, HEIGHT_M * ones, azimuths, np.radians(-2) * ones)
            here = stored.around(at.latitude_deg, at.longitude_deg, 18_520.0)
            states, void = predict(here.grid, at.over(here.extent), 512, 18_520 / 512, Beam())
            assert not void.any()
            found.append(states)
    assert np.count_nonzero(found[0] == DEM_SHADOW) > 2000
    for states in found[1:]:
        np.testing.assert_array_equal(states, found[0])


def crossing(meridian: int, east_deg: float, begin_ns: int = 0) -> Aircraft:
    """Eastward past a place while a scan is made, 21 m to each side."""
    aircraft = flying(latitude_deg=LATITUDE, height_m=HEIGHT_M)
    longitude = (meridian + east_deg + np.array([-0.0002, 0.0002]) + 180) % 360 - 180
    for name, track in aircraft.tracks.items():
        if track.newest:
            values = longitude if name == "longitude_deg" else np.full(2, track.newest[1])
            track.append(begin_ns + np.array([0, 200 * MS]), values, np.zeros(2, np.uint8))
    return aircraft


def echoes(stored: Terrain, east_deg: float) -> Scan:
    """That agree with the stored ground, on radials that are measured one after the other."""
    place = {"latitude_deg": LATITUDE, "longitude_deg": INLAND + east_deg, "height_m": HEIGHT_M}
    scan = honest_scan(stored, **place)
    n = len(scan.time_ns)
    return replace(scan, time_ns=np.linspace(MS, 199 * MS, n).astype(np.int64))


FLOWN = [-0.02, -0.0001, 0.0, 0.0001, 0.02]  # degrees; three of which cross the line within a scan


def flown(monitor: Monitor, meridian: int, scans: list[Scan]) -> list[Verdict]:
    said = []
    for k, (scan, east_deg) in enumerate(zip(scans, FLOWN, strict=True)):
        begin_ns = 4000 * MS * k
        later = replace(scan, time_ns=scan.time_ns + begin_ns)
        said.append(monitor.judge(later, crossing(meridian, east_deg, begin_ns))[0])
    return said


def lakes(directory: Path, meridian: int) -> list[Path]:
    """A lake across the meridian: polygons that are cut where the date line is (RFC 7946), and two rasters."""
    west, east = (meridian - 0.1, meridian + 0.15)
    parts = [square(west, -16.6, meridian, -16.45), square(meridian, -16.6, east, -16.45)]
    if meridian == LINE:
        parts[1] = square(-180, -16.6, east - 360, -16.45)
    document = {"type": "MultiPolygon", "coordinates": [part["coordinates"] for part in parts]}
    ones = np.ones((40, 20), np.uint8)
    beyond = meridian if meridian != LINE else -180
    return [
        written(directory / "cut.geojson", document),
        raster(directory / "west.tif", ones, meridian - 20 / 256, -16.7, 1 / 256),
        raster(directory / "east.tif", ones, beyond, -16.7, 1 / 256),
    ]


SETTINGS: dict[str, dict[str, Any]] = {
    "plain": {},
    "tracked": {"tracked_scans": 2, "tracking_tolerance_m": 300.0},
    "lever arm": {"lever_arm": LeverArm(forward_m=50.0, right_m=30.0)},
    "searched": {"offset_search_m": 400.0},
    "water": {},
}


@pytest.mark.parametrize("asked", SETTINGS)
def test_a_flight_across_gets_the_verdicts_that_it_gets_at_10_degrees(
    files: dict[int, list[Path]], tmp_path: Path, opened: Opened, asked: str
) -> None:
    honest = [echoes(open_terrain(files[INLAND]), east_deg) for east_deg in FLOWN]
    scans = [moved(scan, 9) for scan in honest] if asked == "searched" else honest
    settings = MonitorSettings.model_validate({"offset_search_m": 0.0, **SETTINGS[asked]})
    said = []
    for meridian in (INLAND, LINE):
        stored, water = opened(files[meridian]), None
        if asked == "water":
            (tmp_path / str(meridian)).mkdir()
            water = open_water(lakes(tmp_path / str(meridian), meridian), stored, 1.0)
        monitor = Monitor(stored, settings, CALIBRATED, water)
        warm_up(monitor)
        said.append(flown(monitor, meridian, scans))
    assert said[1] == said[0]
    assert {verdict.verdict for verdict in said[0][1:]} == {"alert" if asked == "searched" else "ok"}
    assert all(verdict.n_pairs > 16 for verdict in said[0][1:])
    if asked == "searched":
        assert all(verdict.offset_north_m is not None for verdict in said[0])
    if asked in ("tracked", "water"):
        assert any("do not count" in reason for reason in said[0][1].reasons)


def wet(water: WaterFiles, stored: Terrain, meridian: int) -> NDArray[np.bool_]:
    here = stored.around(np.array([LATITUDE]), np.array([float(meridian)]), 20_000.0)
    return water.on(here).wet


@pytest.mark.parametrize("number", [0, slice(1, 3)])
def test_water_is_drawn_on_the_same_posts(
    files: dict[int, list[Path]], tmp_path: Path, opened: Opened, number: int | slice
) -> None:
    """The column on the line itself too, or it would part the lake in two."""
    drawn = []
    for meridian in (INLAND, LINE):
        (tmp_path / str(meridian)).mkdir()
        stored = opened(files[meridian])
        named = lakes(tmp_path / str(meridian), meridian)[number]
        drawn.append(wet(open_water(named, stored, 1.0), stored, meridian))
    np.testing.assert_array_equal(drawn[1], drawn[0])
    assert 1000 < np.count_nonzero(drawn[0]) < drawn[0].size / 2


@pytest.mark.parametrize("west", [179.9, -180.1])
@pytest.mark.parametrize("kind", ["geojson", "tif"])
def test_a_polygon_or_a_raster_that_nobody_cut_is_water_on_both_sides(
    files: dict[int, list[Path]], tmp_path: Path, opened: Opened, west: float, kind: str
) -> None:
    drawn = []
    for meridian, corner in ((INLAND, 9.9), (LINE, west)):
        path, stored = tmp_path / f"{meridian}.{kind}", opened(files[meridian])
        if kind == "tif":
            raster(path, np.ones((15, 25), np.uint8), corner, -16.45, 0.01)
        else:
            written(path, square(corner, -16.6, corner + 0.25, -16.45))
        drawn.append(wet(open_water(path, stored, 1.0), stored, meridian))
    np.testing.assert_array_equal(drawn[1], drawn[0])
    assert drawn[0].any()


def unlike_its_neighbour(shape: dict[str, Any]) -> dict[str, Any]:
    """Longitudes between -180 and 180, so that rings jump where they cross the line."""
    rings = [[[(x + 180) % 360 - 180, y] for x, y in ring] for ring in shape["coordinates"]]
    return {"type": "Polygon", "coordinates": rings}


@pytest.mark.parametrize("crs", [None, "EPSG:2193", "EPSG:3413", "EPSG:3995", "EPSG:3571"])
def test_a_polygon_that_jumps_from_179_to_minus_179_is_water_on_both_sides(
    files: dict[int, list[Path]], tmp_path: Path, crs: str | None
) -> None:
    """With an island east of the line, one west of it and one across; GDAL's own transformation leaves such jumps."""
    drawn = []
    for meridian in (INLAND, LINE):
        lake = square(meridian - 0.101, -16.601, meridian + 0.151, -16.451)
        for west, east in ((0.05, 0.07), (-0.09, -0.07), (-0.02, 0.03)):
            lake["coordinates"] += square(meridian + west, -16.549, meridian + east, -16.521)["coordinates"]
        document = unlike_its_neighbour(lake)
        if crs and meridian == LINE:
            to_metres = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
            document["coordinates"] = [[to_metres.transform(*at) for at in ring] for ring in lake["coordinates"]]
            document["crs"] = {"type": "name", "properties": {"name": crs}}
        path, stored = written(tmp_path / f"{meridian}.geojson", document), open_terrain(files[meridian])
        drawn.append(wet(open_water(path, stored, 1.0), stored, meridian))
    np.testing.assert_array_equal(drawn[1], drawn[0])
    assert 1000 < np.count_nonzero(drawn[0]) < drawn[0].size / 2


def test_a_sea_that_goes_once_round_the_earth_along_parallels_is_water_everywhere(
    files: dict[int, list[Path]], tmp_path: Path
) -> None:
    for west, south, north in ((-180, -90, 90), (-180, -20, -10), (0, -20, -10)):
        path = written(tmp_path / "sea.geojson", square(west, south, west + 360, north))
        for meridian in (INLAND, LINE):
            stored = open_terrain(files[meridian])
            assert wet(open_water(path, stored, 1.0), stored, meridian).all()


def test_a_ring_around_a_pole_is_refused_with_the_mend(files: dict[int, list[Path]], tmp_path: Path) -> None:
    ring = [[longitude, -10] for longitude in (0, 90, 179, -90, 0)]
    path = written(tmp_path / "sea.geojson", {"type": "Polygon", "coordinates": [ring]})
    with pytest.raises(WaterError, match=r"sea\.geojson holds a ring around a pole: cut it at the date line"):
        open_water(path, open_terrain(files[LINE]), 1.0)


def test_projected_water_across_the_line_is_drawn_on_both_sides(files: dict[int, list[Path]], tmp_path: Path) -> None:
    """10 km square about a place 1 km east of the line, in the metres of zone 60."""
    stored = open_terrain(files[LINE])
    there = Transformer.from_crs("EPSG:4326", "EPSG:32760", always_xy=True)
    x, y = there.transform(-179.99, LATITUDE)
    ring = square(x - 5000, y - 5000, x + 5000, y + 5000)
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32760"}}
    rows, columns = np.mgrid[: POSTS + 1, : 2 * POSTS + 1]
    east, north = there.transform(179 + columns / POSTS, SOUTH + 1 - rows / POSTS)
    inside = np.maximum(np.abs(east - x), np.abs(north - y)) - 5000  # metres beyond the shore
    for path in (
        written(tmp_path / "lake.geojson", {**ring, "crs": crs}),
        raster(tmp_path / "lake.tif", np.ones((100, 100), np.uint8), x - 5000, y + 5000, 100.0, crs="EPSG:32760"),
    ):
        found = open_water(path, stored, 1.0).on(stored).wet
        sure = np.abs(inside) > 30  # GDAL's approximation, an eighth of a pixel of the raster, and some
        np.testing.assert_array_equal(found[sure], inside[sure] < 0)
        assert found[:, :POSTS].any()
        assert found[:, POSTS + 1 :].any()


def test_an_aircraft_beyond_the_terrain_is_told_where_that_is(files: dict[int, list[Path]], opened: Opened) -> None:
    stored = opened(files[LINE])
    scan = echoes(open_terrain(files[INLAND]), 0.0)
    verdict = Monitor(stored, None, CALIBRATED).judge(scan, crossing(LINE, 2.0))[0]
    assert verdict.verdict == "unavailable"
    assert "at -16.500 -178.000, is outside the stored terrain" in verdict.reasons[0]
    assert "longitudes 179.000 to 181.000" in verdict.reasons[0]


def test_a_gap_below_the_aircraft_is_told_on_the_far_side_too(
    files: dict[int, list[Path]], tmp_path: Path, opened: Opened
) -> None:
    heights, half = np.full((POSTS + 1, POSTS + 1), 500, np.int16), 0.5 / POSTS
    heights[200:300, 40:60] = -9999
    holed = write(tmp_path / "holed.tif", heights, north_up(-180 - half, SOUTH + 1 + half, 1 / POSTS), nodata=-9999)
    scan = echoes(open_terrain(files[INLAND]), 0.0)
    monitor = Monitor(opened([files[LINE][0], holed]), None, CALIBRATED)
    verdict = monitor.judge(scan, crossing(LINE, 50 / POSTS))[0]
    assert "has a gap below the aircraft, at -16.500 -179.903: name a file" in verdict.reasons[0]


def test_the_terrain_thread_is_studied_there_as_anywhere(files: dict[int, list[Path]], opened: Opened) -> None:
    studied = []
    for meridian, at in ((INLAND, "-16.5,10.0625"), (LINE, "-16.5,-179.9375"), (LINE, "-16.5,180.0625")):
        stored = opened(files[meridian])
        place = dem.place_of(stored, at)
        true = Variables(place.latitude_deg, place.longitude_deg, HEIGHT_M, tilt_deg=-2.0)
        setup = dem.setup_of(true, MonitorSettings(), 256, 10.0, 3.0, seed=1)
        here = stored.around(np.array(place.latitude_deg), np.array(place.longitude_deg), setup.reach_m)
        studied.append((place.ground_m, simulate(reached(here.grid, setup), setup, range(1))))
    assert dem.place_of(opened(files[LINE]), None)[:2] == (LATITUDE, 180.0)
    for ground_m, outcome in studied:
        assert ground_m == studied[0][0]
        assert (outcome.shadowed, outcome.lost) == (studied[0][1].shadowed, 0)
        np.testing.assert_array_equal(outcome.residuals, studied[0][1].residuals)
    assert studied[0][1].residuals.front.size > 100
