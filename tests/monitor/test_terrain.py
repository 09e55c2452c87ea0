"""The terrain store against rasterio, the standards' post positions and exact bilinear arithmetic."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from pyproj import Transformer
from rasterio.transform import Affine
from rasterio.windows import Window

from monitor import terrain
from monitor.terrain import Grid, Terrain, open_terrain
from monitor.terrain_files import TerrainError


def write(
    path: Path,
    height_m: NDArray[np.generic],
    transform: Affine,
    crs: str | None = "EPSG:4326",
    nodata: float | None = None,
    band: dict[str, object] | None = None,
) -> Path:
    """A GeoTIFF; `band` gives rasterio's `scales`, `offsets` or `units` of its only one."""
    rows, columns = height_m.shape
    with rasterio.open(
        path, "w", driver="GTiff", height=rows, width=columns, count=1, dtype=height_m.dtype, crs=crs,
        transform=transform, nodata=nodata,
    ) as file:  # fmt: skip
        file.write(height_m, 1)
        for name, value in (band or {}).items():
            setattr(file, name, (value,))
    return path


def north_up(west: float, north: float, spacing: float) -> Affine:
    return Affine(spacing, 0, west, 0, -spacing, north)


def part(source: Path, path: Path, window: Window) -> Path:
    with rasterio.open(source) as whole:
        t = whole.transform
        corner = Affine(t.a, 0, t.c + window.col_off * t.a, 0, t.e, t.f + window.row_off * t.e)
        return write(path, whole.read(1, window=window), corner)


def grid(height_m: list[list[float]]) -> Terrain:
    """Posts a quarter of a degree apart from 45 N 7 E, so that every place below is exact in binary."""
    return Terrain(Grid(np.array(height_m, np.float32), 45.0, 7.0, 0.25, 0.25), [], "")


def test_the_posts_of_an_hgt_cell_lie_where_srtm_puts_them(white_mountains_path: Path) -> None:
    """Row i, column j of 1201 x 1201 big-endian heights is at 45 - i/1200 N, 72 - j/1200 W, the borders included."""
    heights = np.fromfile(white_mountains_path, ">i2").reshape(1201, 1201)
    rng = np.random.default_rng(1)
    i, j = np.r_[0, 0, 1200, 1200, rng.integers(0, 1201, 500)], np.r_[0, 1200, 0, 1200, rng.integers(0, 1201, 500)]
    found = open_terrain(white_mountains_path).elevation(45 - i / 1200, -72 + j / 1200)
    np.testing.assert_allclose(found, heights[i, j], atol=1e-6)


@pytest.mark.parametrize("name", ["white_mountains_path", "sierra_path", "sao_tome_path"])
def test_every_format_agrees_with_rasterio_at_pixel_centres(name: str, request: pytest.FixtureRequest) -> None:
    """GDAL widens HGT and DTED cells by half a post, so its pixel centres are the posts."""
    path = request.getfixturevalue(name)
    terrain = open_terrain(path)
    with rasterio.open(path) as source:
        heights = source.read(1, masked=True)
        solid = ~np.ma.getmaskarray(heights)
        # A place that rounding moves off its post needs the next posts as well.
        surrounded = np.zeros_like(solid)
        surrounded[1:-1, 1:-1] = np.lib.stride_tricks.sliding_window_view(solid, (3, 3)).all(axis=(2, 3))
        i, j = np.argwhere(surrounded)[::997].T
        lon, lat = source.xy(i, j)
    assert len(i) > 500
    np.testing.assert_allclose(terrain.elevation(lat, lon), heights.data[i, j], atol=1e-5)


def test_voids_of_the_files_are_nan_and_never_the_number_that_marks_them(
    sierra_path: Path, sao_tome_path: Path
) -> None:
    for path, lowest in ((sierra_path, 886), (sao_tome_path, -7)):
        terrain = open_terrain(path)
        with rasterio.open(path) as source:
            void = np.argwhere(source.read_masks(1) == 0)
            lon, lat = source.xy(*void.T)
        assert len(void) > 1000
        assert np.isnan(terrain.elevation(lat, lon)).all()
        assert np.nanmin(terrain.grid.height_m) == lowest
        steps = np.linspace(-2, 2, 41) * terrain.grid.row_deg
        near = terrain.elevation(np.array(lat)[:50, None] + steps, np.array(lon)[:50, None] + steps)
        assert np.nanmin(near) >= lowest


def test_halfway_between_posts_is_their_mean() -> None:
    terrain = grid([[10, 20, 40], [30, 80, 100]])
    lat, lon = [45.0, 44.875, 44.875, 44.75, 44.9375], [7.125, 7.0, 7.125, 7.5, 7.3125]
    quarter = 0.75 * (0.75 * 20 + 0.25 * 40) + 0.25 * (0.75 * 80 + 0.25 * 100)
    assert terrain.elevation(lat, lon).tolist() == [15, 20, 35, 100, quarter]


def test_any_shape_goes_in_and_comes_out() -> None:
    terrain = grid([[1, 2], [3, 4]])
    assert terrain.elevation(45.0, 7.0).shape == ()
    assert terrain.elevation(np.full((2, 3), 45.0), 7.0).tolist() == [[1.0] * 3] * 2


def test_a_void_post_spoils_the_four_cells_around_it_and_nothing_else() -> None:
    heights = np.arange(25.0).reshape(5, 5)
    heights[2, 1] = np.nan
    centres = np.arange(4) * 0.25 + 0.125
    found = grid(heights.tolist()).elevation(45 - centres[:, None], 7 + centres)
    assert np.isnan(found).tolist() == [[False] * 4, *[[True, True, False, False]] * 2, [False] * 4]


def test_outside_the_posts_is_nan() -> None:
    terrain = grid([[1, 2], [3, 4]])
    tiny = 1e-9
    inside = terrain.elevation([45, 45, 44.75, 44.75], [7, 7.25, 7, 7.25])
    outside = terrain.elevation([45 + tiny, 45, 44.75 - tiny, 44.75], [7, 7.25 + tiny, 7, 7 - tiny])
    no_place = terrain.elevation(*np.meshgrid([44.9, np.nan, np.inf, -1e300], [7.1, np.nan, -np.inf, 1e300]))
    assert inside.tolist() == [1, 2, 3, 4]
    assert np.isnan(outside).all()
    assert np.count_nonzero(~np.isnan(no_place)) == 1


@pytest.mark.parametrize("south_first", [False, True])
def test_a_mosaic_of_two_halves_is_the_whole(white_mountains_path: Path, tmp_path: Path, south_first: bool) -> None:
    """Both orders, one row in common as between SRTM cells."""
    north = part(white_mountains_path, tmp_path / "north.tif", Window(0, 0, 1201, 601))
    south = part(white_mountains_path, tmp_path / "south.tif", Window(0, 600, 1201, 601))
    whole = open_terrain(white_mountains_path)
    mosaic = open_terrain([south, north] if south_first else [north, south])
    np.testing.assert_array_equal(mosaic.grid.height_m, whole.grid.height_m)
    np.testing.assert_allclose(mosaic.grid[1:5], whole.grid[1:5], atol=1e-9)
    np.testing.assert_array_equal(mosaic.grid.ceiling_m, whole.grid.ceiling_m)
    assert mosaic.checksum != whole.checksum


def test_between_the_files_of_a_mosaic_is_nan_and_a_void_is_filled_from_the_next_file(tmp_path: Path) -> None:
    holed = np.array([[1, -9], [3, 4]], np.int16)
    first = write(tmp_path / "first.tif", holed, north_up(7, 45, 0.25), nodata=-9)
    second = write(tmp_path / "second.tif", holed + np.int16(10), north_up(7, 45, 0.25))
    far = write(tmp_path / "far.tif", holed, north_up(8, 45, 0.25), nodata=-9)
    assert open_terrain([first, second]).grid.height_m.tolist() == [[1, 1], [3, 4]]
    np.testing.assert_array_equal(open_terrain([first, far]).grid.height_m[1], [3, 4, np.nan, np.nan, 3, 4])


@pytest.mark.parametrize("origin", [(7.005, 45.0, 0.01), (7.0, 45.105, 0.01), (7.1, 45.0, 0.02)])
def test_a_file_off_the_grid_of_the_first_is_refused_by_name(
    tmp_path: Path, origin: tuple[float, float, float]
) -> None:
    west, north, spacing = origin
    heights = np.ones((10, 10), np.int16)
    first = write(tmp_path / "first.tif", heights, north_up(7.0, 45.0, 0.01))
    other = write(tmp_path / "other.tif", heights, north_up(west, north, spacing))
    with pytest.raises(TerrainError, match=r"other\.tif is not on the grid.*gdalwarp"):
        open_terrain([first, other])


def test_a_missing_file_is_named_with_where_to_mend_it(tmp_path: Path) -> None:
    with pytest.raises(TerrainError, match=r"lost\.tif does not exist.*--dem"):
        open_terrain(tmp_path / "lost.tif")


def test_a_file_that_is_no_raster_is_named(tmp_path: Path) -> None:
    (tmp_path / "notes.tif").write_text("no raster")
    with pytest.raises(TerrainError, match=r"notes\.tif cannot be read as terrain \(GeoTIFF, HGT or DTED\)"):
        open_terrain(tmp_path / "notes.tif")


def test_a_torn_file_is_named(white_mountains_path: Path, tmp_path: Path) -> None:
    torn = part(white_mountains_path, tmp_path / "torn.tif", Window(0, 0, 300, 300))
    torn.write_bytes(torn.read_bytes()[:60_000])
    with pytest.raises(TerrainError, match=r"torn\.tif cannot be read"):
        open_terrain(torn)


def test_a_raster_without_a_place_on_earth_is_named_with_the_mend(tmp_path: Path) -> None:
    path = write(tmp_path / "nowhere.tif", np.ones((3, 3), np.int16), north_up(7, 45, 1), crs=None)
    with pytest.raises(TerrainError, match=r"nowhere\.tif has no coordinate reference system.*gdal_edit"):
        open_terrain(path)


MOON = 'GEOGCS["Moon",DATUM["Moon",SPHEROID["Moon",1737400,0]],PRIMEM["Moon",0],UNIT["degree",0.0174532925199433]]'


@pytest.mark.parametrize("crs", [MOON, 'LOCAL_CS["a building site",UNIT["metre",1]]'])
def test_a_place_that_is_not_on_earth_is_named_with_the_mend(tmp_path: Path, crs: str) -> None:
    path = write(tmp_path / "moon.tif", np.ones((3, 3), np.int16), north_up(7, 45, 1), crs=crs)
    with pytest.raises(TerrainError, match=r"moon\.tif has a coordinate reference system that is of no place on Earth"):
        open_terrain(path)


@pytest.mark.parametrize("corner", [(7, 96), (7, -88), (math.nan, 45), (7, math.nan)])
def test_posts_beyond_the_poles_or_nowhere_are_refused(tmp_path: Path, corner: tuple[float, float]) -> None:
    path = write(tmp_path / "off.tif", np.ones((5, 5), np.int16), north_up(*corner, 1))
    with pytest.raises(TerrainError, match=r"off\.tif has posts at no latitude or longitude: mend it with gdal_edit"):
        open_terrain(path)


def test_a_raster_that_is_not_north_up_is_named_with_the_mend(tmp_path: Path) -> None:
    turned = Affine(0.1, 0.02, 7, 0.02, -0.1, 45)
    path = write(tmp_path / "turned.tif", np.ones((3, 3), np.int16), turned)
    with pytest.raises(TerrainError, match=r"turned\.tif is not a north-up raster.*gdalwarp"):
        open_terrain(path)


@pytest.mark.parametrize("heights", [[[100, 30_000], [0, 0]], [[-2000, 0], [0, 0]]])
def test_heights_that_no_ground_has_are_refused_with_the_mend(tmp_path: Path, heights: list[list[int]]) -> None:
    path = write(tmp_path / "noise.tif", np.array(heights, np.int16), north_up(7, 45, 0.25))
    with pytest.raises(TerrainError, match=r"noise.tif holds heights of .* m: mark voids as nodata"):
        open_terrain(path)


@pytest.mark.parametrize("unit", ["", "m", "Metre", "METER"])
def test_heights_are_what_a_file_s_scale_and_offset_make_of_its_numbers(tmp_path: Path, unit: str) -> None:
    """0.1 x 9000 + 50 is 950 m, and the number of voids is none of a height."""
    numbers = np.array([[9000, 10_000], [-30, -32_768]], np.int16)
    band: dict[str, object] = {"scales": 0.1, "offsets": 50.0, "units": unit}
    path = write(tmp_path / "scaled.tif", numbers, north_up(7, 45, 0.25), nodata=-32_768, band=band)
    np.testing.assert_allclose(open_terrain(path).grid.height_m, np.array([[950, 1050], [47, np.nan]]), rtol=1e-6)


def test_scale_and_offset_hold_for_a_projected_file_too(tmp_path: Path) -> None:
    numbers = np.full((40, 40), 9000, np.int16)
    band: dict[str, object] = {"scales": 0.1, "offsets": 50.0}
    path = write(tmp_path / "utm.tif", numbers, north_up(EAST, NORTH, SPACING), crs="EPSG:32619", band=band)
    height_m = open_terrain(path).grid.height_m
    np.testing.assert_allclose(height_m[np.isfinite(height_m)], 950, rtol=1e-6)
    assert np.isfinite(height_m).sum() > 1000


@pytest.mark.parametrize(
    ("crs", "band", "unit", "scale"),
    [
        ("EPSG:4326", {"units": "ft"}, "ft", "0 0.3048"),
        ("EPSG:4326", {"units": "Feet", "scales": 0.1, "offsets": 50.0}, "Feet", "15.24 15.27048"),
        ("EPSG:4326+6360", {}, "US survey foot", "0 0.3048"),
        ("EPSG:32619+6360", {}, "US survey foot", "0 0.3048"),
    ],
)
def test_feet_are_refused_with_the_command_that_makes_them_metres(
    tmp_path: Path, crs: str, band: dict[str, object], unit: str, scale: str
) -> None:
    """50 ft are 15.24 m, and 50.1 ft 15.27048; GDAL takes the unit of a compound system's vertical axis too."""
    path = write(tmp_path / "feet.tif", np.ones((4, 4), np.int16), north_up(7, 45, 0.25), crs=crs, band=band)
    mend = f"gdal_translate -ot Float32 -scale 0 1 {scale} -a_scale 1 -a_offset 0 {path} metres.tif, then gdal_edit.py"
    with pytest.raises(TerrainError, match=re.escape(f"{path} has heights in '{unit}', and metres are needed: {mend}")):
        open_terrain(path)


def test_a_unit_that_nobody_knows_is_refused_by_name(tmp_path: Path) -> None:
    path = write(tmp_path / "far.tif", np.ones((3, 3), np.int16), north_up(7, 45, 0.25), band={"units": "km"})
    with pytest.raises(TerrainError, match=r"far\.tif has heights in 'km', and metres are needed: convert its heights"):
        open_terrain(path)


@pytest.mark.parametrize("crs", ["EPSG:4979", "+proj=utm +zone=19 +datum=WGS84 +vunits=m"])
def test_heights_above_the_ellipsoid_are_refused_with_the_mend(tmp_path: Path, crs: str) -> None:
    path = write(tmp_path / "high.tif", np.ones((3, 3), np.int16), north_up(7, 45, 0.25), crs=crs)
    with pytest.raises(TerrainError, match=r"high\.tif has heights above the ellipsoid, .*: gdalwarp -t_srs EPSG:4326"):
        open_terrain(path)


@pytest.mark.parametrize("geoid", [5773, 3855])
def test_metres_above_a_geoid_that_the_reference_system_names_are_taken(tmp_path: Path, geoid: int) -> None:
    path = write(tmp_path / "egm.tif", np.full((3, 3), 7, np.int16), north_up(7, 45, 0.25), crs=f"EPSG:4326+{geoid}")
    assert open_terrain(path).elevation(44.5, 7.4) == 7


def test_a_picture_is_no_terrain(tmp_path: Path) -> None:
    path = tmp_path / "map.tif"
    with rasterio.open(
        path, "w", driver="GTiff", height=2, width=2, count=3, dtype="uint8", crs="EPSG:4326",
        transform=north_up(7, 45, 0.25),
    ) as file:  # fmt: skip
        file.write(np.zeros((3, 2, 2), np.uint8))
    with pytest.raises(TerrainError, match="has 3 bands"):
        open_terrain(path)


@pytest.mark.parametrize("shape", [(1, 5), (5, 1)])
def test_a_line_of_posts_is_no_terrain(tmp_path: Path, shape: tuple[int, int]) -> None:
    path = write(tmp_path / "line.tif", np.zeros(shape, np.int16), north_up(7, 45, 0.25))
    with pytest.raises(TerrainError, match=f"has {shape[0]} x {shape[1]} posts: 2 x 2 are the least"):
        open_terrain(path)


def test_files_far_apart_open_and_are_not_loaded_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terrain, "WHOLE_POSTS", 1000)
    monkeypatch.setattr(terrain, "MOST_POSTS", 1000)
    heights = np.full((4, 4), 7, np.int16)
    near = write(tmp_path / "near.tif", heights, north_up(7, 45, 0.25))
    far = write(tmp_path / "far.tif", heights, north_up(107, 45, 0.25))
    wide = open_terrain([near, far])
    assert wide.elevation(44.5, [7.5, 50, 107.5]).tolist()[::2] == [7, 7]
    with pytest.raises(TerrainError, match=r"spans 4 x 404 posts.*choose a shorter range"):
        wide.grid.height_m.sum()


def test_no_file_at_all_is_refused() -> None:
    with pytest.raises(TerrainError, match="at least one"):
        open_terrain([])


EAST, NORTH, SPACING = 300_000.0, 4_910_000.0, 30.0  # UTM zone 19


def utm_plane(path: Path) -> Path:
    """A tilted plane, 5 cm a metre eastward and -3 cm northward, without a nodata value."""
    i, j = np.mgrid[:400, :400]
    plane = 500 + 0.05 * SPACING * (j + 0.5) + 0.03 * SPACING * (i + 0.5)
    return write(path, plane.astype(np.float32), north_up(EAST, NORTH, SPACING), crs="EPSG:32619")


def test_a_projected_file_is_warped_to_degrees(tmp_path: Path) -> None:
    """Bilinear resampling keeps a plane; GDAL places pixels to an eighth, 22 cm of height on the slope of 5.8 %."""
    terrain = open_terrain(utm_plane(tmp_path / "utm.tif"))
    east, north = np.random.default_rng(2).uniform(100, 11_900, (2, 500))
    lon, lat = Transformer.from_crs("EPSG:32619", "EPSG:4326", always_xy=True).transform(EAST + east, NORTH - north)
    expected = 500 + 0.05 * east + 0.03 * north
    np.testing.assert_allclose(terrain.elevation(lat, lon), expected, atol=0.125 * SPACING * np.hypot(0.05, 0.03))


def test_the_corners_that_a_projected_file_does_not_reach_are_voids_and_not_sea_level(tmp_path: Path) -> None:
    terrain = open_terrain(utm_plane(tmp_path / "utm.tif"))
    assert np.isnan(terrain.grid.height_m).any()
    assert np.nanmin(terrain.grid.height_m) >= 500
