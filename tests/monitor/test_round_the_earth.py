"""How terrain files lie about the Earth: on both sides of the date line, all round, and with gaps between them."""

import math
from pathlib import Path

import numpy as np
import pytest
import rasterio
from pyproj import Transformer

from monitor.terrain import WideTerrain, open_terrain
from monitor.terrain_files import TerrainError
from tests.monitor.conftest import Opened
from tests.monitor.ground import either_side
from tests.monitor.test_terrain import north_up, write


@pytest.mark.parametrize(("zone", "epsg"), [(60, 32760), (1, 32701)])
def test_a_projected_file_across_the_line_is_warped_as_one(
    tmp_path: Path, opened: Opened, zone: int, epsg: int
) -> None:
    """A tilted plane, to the eighth of a post in which GDAL places pixels."""
    there = Transformer.from_crs("EPSG:4326", f"EPSG:{epsg}", always_xy=True)
    x0, y0 = (round(axis) for axis in there.transform(180.0, -17.0))
    i, j = np.mgrid[:400, :400]
    plane = (500 + 1.5 * (j + 0.5) + 0.9 * (i + 0.5)).astype(np.float32)
    path = write(tmp_path / "utm.tif", plane, north_up(x0 - 6000, y0 + 6000, 30), crs=f"EPSG:{epsg}")
    east, south = np.random.default_rng(6).uniform(200, 11_800, (2, 300))
    longitude, latitude = there.transform(x0 - 6000 + east, y0 + 6000 - south, direction="INVERSE")
    assert longitude.max() > 179.9 > -179.9 > longitude.min()
    found = opened(path).elevation(latitude, longitude)
    np.testing.assert_allclose(found, 500 + 0.05 * east + 0.03 * south, atol=30 / 8 * math.hypot(0.05, 0.03))


@pytest.mark.parametrize(("west", "columns"), [(-180, 720), (-180, 721), (0, 720), (0, 721)])
def test_a_file_that_goes_all_round_has_no_end(tmp_path: Path, opened: Opened, west: int, columns: int) -> None:
    """Half a degree between posts; the last of 721 columns repeats the first."""
    heights = np.random.default_rng(7).integers(0, 3000, (21, 720)).astype(np.int16)[:, np.arange(columns) % 720]
    path = write(tmp_path / "all.tif", heights, north_up(west - 0.25, 5.25, 0.5))
    found = opened(path)
    corner = [0.0, 0.25, 359.5, 359.75]
    upper = heights[10, [0, 0, 719, 719]] * [1, 0.5, 1, 0.5] + heights[10, [0, 1, 719, 0]] * [0, 0.5, 0, 0.5]
    for longitude in either_side(west + np.array(corner)):
        np.testing.assert_allclose(found.elevation(0.0, longitude), upper)
    for here in (west - 0.01, west + 359.99):
        crossing = np.array([here, here + 0.02])
        for longitude in either_side(crossing):
            grid = found.around(np.zeros(2), longitude, 100_000.0).grid
            assert np.isfinite(grid.height_m).all()
            if isinstance(found, WideTerrain):
                assert grid.height_m.shape[1] < 10, "the ground on either side, and not the long way round"


def test_tiles_that_go_all_round_have_no_end_either(tmp_path: Path, opened: Opened) -> None:
    heights = np.random.default_rng(8).integers(0, 3000, (21, 721)).astype(np.int16)
    heights[:, 720] = heights[:, 0]
    paths = [
        write(tmp_path / f"{k}.tif", heights[:, k * 120 : k * 120 + 121], north_up(60 * k - 180.25, 5.25, 0.5))
        for k in (3, 0, 5, 1, 4, 2)
    ]
    k = np.r_[0:720:11, 718, 719]
    for longitude in either_side(-180 + k / 2):
        np.testing.assert_array_equal(opened(paths).elevation(0.0, longitude), heights[10, k])


def test_files_begin_behind_the_widest_gap_and_stay_where_they_are_if_they_can(tmp_path: Path) -> None:
    heights = np.zeros((11, 11), np.int16)

    def span(*wests: int) -> tuple[float, float]:
        paths = [write(tmp_path / f"{west}.tif", heights, north_up(west - 0.05, 0.05, 0.1)) for west in wests]
        spans = {open_terrain(order).extent[2:] for order in (paths, paths[::-1])}
        (found,) = {(round(west, 6), round(east, 6)) for west, east in spans}
        return found

    assert span(7, 107) == (7, 108)
    assert span(-170, -3, 9) == (-170, 10)
    assert span(-60, 60, 170) == (-60, 171)
    assert span(170, -175) == (170, 186)
    assert span(120, -175, -10) == (-10, 186)
    assert span(120, -175, -50) == (120, 311)
    assert span(-10, 100, 179, -180, -170) == (-10, 191)


@pytest.mark.parametrize("origin", [(400.0, 0.25), (-400.0, 0.25), (0.0, 200.0), (0.0, 1e-310)])
def test_posts_at_no_longitude_are_refused(tmp_path: Path, origin: tuple[float, float]) -> None:
    west, step = origin
    path = tmp_path / "off.tif"
    with rasterio.open(
        path, "w", driver="GTiff", height=5, width=5, count=1, dtype="int16", crs="EPSG:4326",
        transform=rasterio.Affine(step, 0, west, 0, -0.25, 45),
    ) as file:  # fmt: skip
        file.write(np.ones((5, 5), np.int16), 1)
    with pytest.raises(TerrainError, match=r"off\.tif has posts at no latitude or longitude"):
        open_terrain(path)
