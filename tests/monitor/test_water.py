"""The water mask: how files are drawn on posts, how large water is, what is refused, and what a scan loses by it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from pyproj import Geod, Transformer
from rasterio.transform import Affine
from scipy.optimize import brentq

from monitor.integrity import Monitor
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import shadows
from monitor.terrain import Grid, Terrain
from monitor.water import WaterError, WaterFiles, open_water
from tests.monitor.scanning import ANGLES, CALIBRATED, HERE, flying, judge

# Posts 0.01 degrees apart at 45 N: 1.1 km southward and 0.79 km eastward, 0.876 square kilometres each.
TERRAIN = Terrain(Grid(np.zeros((20, 30), np.float32), 45.1, 7.0, 0.01, 0.01), [], "")
GEOD = Geod(ellps="WGS84")
BIN_M = 18_520 / 512


def square(west: float, south: float, east: float, north: float) -> dict[str, Any]:
    """A rectangle, counter-clockwise from its south-western corner."""
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {"type": "Polygon", "coordinates": [ring]}


def written(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document))
    return path


def raster(path: Path, values: NDArray[Any], west: float, north: float, step: float, **more: Any) -> Path:
    rows, columns = values.shape
    more = {"crs": "EPSG:4326", **more}
    with rasterio.open(
        path, "w", driver="GTiff", height=rows, width=columns, count=1, dtype=values.dtype,
        transform=Affine(step, 0, west, 0, -step, north), **more,
    ) as file:  # fmt: skip
        file.write(values, 1)
    return path


def posts(water: WaterFiles) -> set[tuple[int, int]]:
    return {(int(row), int(column)) for row, column in zip(*np.nonzero(water.on(TERRAIN).wet), strict=True)}


FOUR = {(3, 5), (3, 6), (4, 5), (4, 6)}  # posts at 45.07 and 45.06 N, 7.05 and 7.06 E
OVER_FOUR = square(7.045, 45.055, 7.065, 45.075)


@pytest.mark.parametrize(
    "document",
    [
        OVER_FOUR,
        {"type": "Feature", "properties": {}, "geometry": OVER_FOUR},
        {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": None, "geometry": OVER_FOUR}]},
        {"type": "GeometryCollection", "geometries": [{"type": "Point", "coordinates": [0, 0]}, OVER_FOUR]},
        {"type": "MultiPolygon", "coordinates": [OVER_FOUR["coordinates"]]},
    ],
    ids=lambda document: document["type"],
)
def test_posts_inside_polygons_are_water_however_geojson_holds_them(tmp_path: Path, document: object) -> None:
    assert posts(open_water(written(tmp_path / "w.geojson", document), TERRAIN, 0.0)) == FOUR


def test_an_island_is_land(tmp_path: Path) -> None:
    lake = square(7.045, 45.035, 7.075, 45.075)
    lake["coordinates"].append(square(7.055, 45.055, 7.065, 45.065)["coordinates"][0])
    found = posts(open_water(written(tmp_path / "w.json", lake), TERRAIN, 0.0))
    assert found == {(row, column) for row in (3, 4, 5, 6) for column in (5, 6, 7)} - {(4, 6)}


def test_polygons_in_another_reference_system_are_transformed(tmp_path: Path) -> None:
    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)
    ring = [list(to_utm.transform(x, y)) for x, y in OVER_FOUR["coordinates"][0]]
    document = {
        "type": "Polygon",
        "coordinates": [ring],
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32632"}},
    }
    assert posts(open_water(written(tmp_path / "w.geojson", document), TERRAIN, 0.0)) == FOUR
    document["crs"]["properties"]["name"] = "EPSG:999999"  # type: ignore[index]
    with pytest.raises(WaterError, match="reference system that is known"):
        open_water(written(tmp_path / "w.geojson", document), TERRAIN, 0.0)


def test_a_polygon_that_lies_nowhere_in_its_reference_system_is_refused_by_name(tmp_path: Path) -> None:
    crs = {"type": "name", "properties": {"name": "EPSG:2193"}}
    path = written(tmp_path / "w.geojson", {**square(-1e30, -1e30, 1e30, 1e30), "crs": crs})
    with pytest.raises(WaterError, match=r"w\.geojson cannot be read as a raster or GeoJSON: .*projection"):
        open_water(path, TERRAIN, 0.0)


def test_every_value_but_0_and_nodata_of_a_raster_is_water(tmp_path: Path) -> None:
    values = np.zeros((20, 30), np.uint8)
    values[3, 5:7], values[4, 5:7], values[9, 9] = 1, 200, 255
    path = raster(tmp_path / "w.tif", values, 6.995, 45.105, 0.01, nodata=255)
    assert posts(open_water(path, TERRAIN, 0.0)) == FOUR
    values = np.where(values == 255, np.nan, values).astype(np.float32)
    assert posts(open_water(raster(tmp_path / "f.tif", values, 6.995, 45.105, 0.01), TERRAIN, 0.0)) == FOUR


def test_a_raster_that_covers_a_part_of_the_terrain_says_nothing_of_the_rest(tmp_path: Path) -> None:
    path = raster(tmp_path / "w.tif", np.ones((4, 4), np.uint8), 7.045, 45.075, 0.005)
    assert posts(open_water(path, TERRAIN, 0.0)) == FOUR


def test_a_raster_in_another_reference_system_is_transformed(tmp_path: Path) -> None:
    west, north = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(7.045, 45.075)
    path = raster(tmp_path / "w.tif", np.ones((22, 16), np.uint8), west, north, 100.0, crs="EPSG:32632")
    assert posts(open_water(path, TERRAIN, 0.0)) == FOUR


def test_several_files_are_one_water_with_a_checksum_of_them_all(tmp_path: Path) -> None:
    one = written(tmp_path / "a.geojson", square(7.045, 45.055, 7.055, 45.075))
    two = written(tmp_path / "b.geojson", square(7.055, 45.055, 7.065, 45.075))
    both = open_water([one, two], TERRAIN, 0.0)
    assert posts(both) == FOUR
    assert both.checksum not in {open_water(path, TERRAIN, 0.0).checksum for path in (one, two)}


def test_only_large_water_counts_with_what_touches_at_a_corner(tmp_path: Path) -> None:
    """A post is 0.876 km2: pyproj gives that of its cell. Two that touch at a corner are 1.75, one alone is 0.876."""
    cell_km2 = abs(GEOD.polygon_area_perimeter([7.045, 7.055, 7.055, 7.045], [45.055, 45.055, 45.065, 45.065])[0]) / 1e6
    shapes = [
        square(7.045, 45.055, 7.055, 45.065),
        square(7.055, 45.045, 7.065, 45.055),
        square(7.195, 45.005, 7.205, 45.015),
    ]
    document = {"type": "GeometryCollection", "geometries": shapes}
    path = written(tmp_path / "w.geojson", document)
    corner, alone = {(4, 5), (5, 6)}, {(9, 20)}
    for large_km2, expected in (
        (0.995 * cell_km2, corner | alone),
        (1.01 * cell_km2, corner),
        (1.995 * cell_km2, corner),
        (2.01 * cell_km2, set()),
    ):
        assert posts(open_water(path, TERRAIN, large_km2)) == expected


@pytest.mark.parametrize(
    ("document", "why"),
    [
        ({"type": "Point", "coordinates": [7.05, 45.05]}, "holds no polygons"),
        ([1, 2], "holds no polygons"),
        ({"type": "FeatureCollection", "features": 5}, "holds no polygons"),
        ({"type": "Polygon", "coordinates": [[[7, 45], [8, 45]]]}, "closed rings"),
        ({"type": "Polygon", "coordinates": 7}, "closed rings"),
        ({"type": "Polygon", "coordinates": [[["a", "b"]] * 4]}, "closed rings"),
        ({"type": "Polygon", "coordinates": [[["7", "45"]] * 4]}, "closed rings"),
        ({"type": "Polygon", "coordinates": [[[7, 45], [7.1, 45], [7.1], [7, 45]]]}, "closed rings"),
        ({"type": "Polygon", "coordinates": [[[7, 45], [7.1, 45], [1e999, 45.1], [7, 45]]]}, "closed rings"),
        ({"type": "Polygon", "coordinates": []}, "closed rings"),
        ({"type": "MultiPolygon", "coordinates": [[]]}, "closed rings"),
        ({"type": "MultiPolygon"}, "closed rings"),
        (square(17.0, 45.0, 17.1, 45.1), "outside the terrain"),
    ],
)
def test_geojson_that_says_nothing_of_the_terrain_is_refused_by_name(
    tmp_path: Path, document: object, why: str
) -> None:
    with pytest.raises(WaterError, match=rf"w\.geojson .*{why}"):
        open_water(written(tmp_path / "w.geojson", document), TERRAIN, 1.0)


def test_files_that_cannot_be_used_are_refused_by_name(tmp_path: Path) -> None:
    ones = np.ones((4, 4), np.uint8)
    broken = tmp_path / "broken.geojson"
    broken.write_text("{")
    deep = tmp_path / "deep.geojson"
    deep.write_text("[" * 100_000)
    (tmp_path / "text.tif").write_text("no raster")
    (tmp_path / "latin.geojson").write_bytes(b"\xff\xfe{")
    two = tmp_path / "two.tif"
    with rasterio.open(
        two, "w", driver="GTiff", height=4, width=4, count=2, dtype="uint8", crs="EPSG:4326",
        transform=Affine(0.01, 0, 7, 0, -0.01, 45.1),
    ) as file:  # fmt: skip
        file.write(np.ones((2, 4, 4), np.uint8))
    for path, why in (
        (tmp_path / "none.tif", "cannot be read"),
        (tmp_path / "text.tif", "cannot be read"),
        (tmp_path, "cannot be read"),
        (broken, "cannot be read"),
        (deep, "cannot be read"),
        (tmp_path / "latin.geojson", "cannot be read"),
        (raster(tmp_path / "nowhere.tif", ones, 7, 45.1, 0.01, crs=None), "has no coordinate reference system"),
        (raster(tmp_path / "far.tif", ones, 17, 45.1, 0.01), "outside the terrain"),
        (two, "has 2 bands"),
    ):
        with pytest.raises(WaterError, match=f"{path.name} .*{why}"):
            open_water(path, TERRAIN, 1.0)


def longitude_of(terrain: Terrain, azimuth_deg: float, range_m: float) -> float:
    """Of the ground at a slant range, solved by Brent's method over pyproj's geodesics."""

    def at(distance_m: float) -> tuple[float, float]:
        longitude, latitude, _ = GEOD.fwd(HERE["longitude_deg"], HERE["latitude_deg"], azimuth_deg, distance_m)
        return float(longitude), float(latitude)

    def excess_m(distance_m: float) -> float:
        longitude, latitude = at(distance_m)
        depth_m = HERE["height_m"] - float(terrain.elevation(latitude, longitude))
        return float(np.hypot(distance_m, depth_m)) - range_m

    return at(float(brentq(excess_m, 0.0, range_m + 1.0)))[0]


def test_shadows_with_a_dark_bin_over_large_water_do_not_count_in_either_thread(
    white_mountains: Terrain, honest: Scan, tmp_path: Path
) -> None:
    """All ground west of a meridian, half a post beside the posts, becomes a lake."""
    shore = -72 + 250.5 / 1200
    lake = square(-72.1, 43.9, shore, 45.1)
    water = open_water(written(tmp_path / "lake.geojson", lake), white_mountains, 1.0)
    _, plain = judge(white_mountains, honest)
    found = shadows(plain.dem_states, "dem", 3)
    wet = []
    for shadow in found:
        azimuth = HERE["heading_deg"] + ANGLES[shadow["radial"]]
        last = shadow["back"] if shadow["range_limited"] else shadow["back"] - 1
        # of dark bins in a row on a straight line the first or the last is the westernmost
        ends = [longitude_of(white_mountains, azimuth, (j - 0.5) * BIN_M) for j in (shadow["front"] + 1, last)]
        wet.append(min(ends) < shore)
        assert abs(min(ends) - shore) > 3e-5, "nearer than 2.4 m to the shore either answer would be right"
    dry_pairs = len({int(s["radial"]) for s in found[~np.array(wet) & ~found["range_limited"]]})
    verdict, comparison = Monitor(white_mountains, MonitorSettings(), CALIBRATED, water).judge(honest, flying())
    assert comparison is not None
    n = sum(wet)
    assert 5 < n < len(found) - 5
    assert verdict.reasons == (
        f"{n} radar and {n} terrain shadows do not count: over water of 1 square kilometres or more",
    )
    assert verdict.n_pairs == dry_pairs < judge(white_mountains, honest)[0].n_pairs
    assert (verdict.verdict, verdict.unmatched_radar, verdict.unmatched_dem) == ("ok", 0, 0)


def test_water_that_is_not_large_costs_nothing(white_mountains: Terrain, honest: Scan, tmp_path: Path) -> None:
    lake = written(tmp_path / "lake.geojson", square(-72.1, 43.9, -70.9, 45.1))
    water = open_water(lake, white_mountains, 1e6)
    verdict, _ = Monitor(white_mountains, MonitorSettings(), CALIBRATED, water).judge(honest, flying())
    assert verdict == judge(white_mountains, honest)[0]


def test_water_that_has_no_effect_is_told(white_mountains: Terrain, tmp_path: Path) -> None:
    lake = written(tmp_path / "lake.geojson", square(-71.6, 44.4, -71.5, 44.5))
    pond, large = (Monitor(white_mountains, water=open_water(lake, white_mountains, km2)) for km2 in (200.0, 1.0))
    assert pond.told_first == [f"no water of 200 km2 or more lies on the terrain: {lake} has no effect"]
    assert not large.told_first
