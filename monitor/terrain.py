"""The terrain store: GeoTIFF, SRTM HGT and DTED files as one grid of posts, sampled bilinearly.

Posts are indexed by pixel *centres*: GDAL widens the bounds of HGT and DTED cells by half a post, so the centres are
the posts of the standard. Voids become NaN before anything interpolates, so a void post spoils the four cells around
it and nothing else.
"""

import math
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rasterio
from numba import njit
from numpy.typing import ArrayLike, NDArray
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.errors import RasterioError
from rasterio.vrt import WarpedVRT

from monitor.ceiling import ceilings

MOST_POSTS = 400_000_000  # 1.6 GB; files far apart would fill the memory with nothing
WGS84 = CRS.from_epsg(4326)
LOWEST_M, HIGHEST_M = -500.0, 9000.0  # no ground on Earth lies outside
ALIGNMENT_POSTS = 0.05  # files whose posts miss a common grid by more are refused: resampling is not ours to hide
NO_CEILING = np.empty((0, 0), np.float32)


class TerrainError(ValueError):
    """A terrain file that is missing, unreadable, without a place on Earth, or not on the grid of its neighbours."""


class Grid(NamedTuple):
    """Posts in degrees north and east; `height_m` is float32 (rows southward, columns eastward), NaN where void.

    There are at least two rows and two columns, or nothing lies between posts.
    """

    height_m: NDArray[np.float32]
    north_deg: float
    west_deg: float
    row_deg: float
    column_deg: float
    ceiling_m: NDArray[np.float32] = NO_CEILING


class Terrain:
    """Stored terrain heights. Made by `open_terrain`."""

    def __init__(self, grid: Grid, paths: Sequence[Path], checksum: str) -> None:
        self.grid = grid
        self.paths = tuple(paths)
        self.checksum = checksum

    def elevation(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> NDArray[np.float64]:
        """Heights in metres at WGS 84 degrees, any shape; NaN where a needed post is void or outside the files."""
        lat, lon = np.broadcast_arrays(np.asarray(latitude_deg, float), np.asarray(longitude_deg, float))
        return _sample_all(self.grid, lat.ravel(), lon.ravel()).reshape(lat.shape)


def open_terrain(path_or_paths: str | Path | Sequence[str | Path]) -> Terrain:
    """Open one terrain file or mosaic several that share a post spacing.

    Raises TerrainError, naming the file and the mend, for a file that is missing, cannot be read, has no coordinate
    reference system, or does not lie on the same grid as the first. Of overlapping files the first with a height wins.
    """
    given = [path_or_paths] if isinstance(path_or_paths, str | Path) else list(path_or_paths)
    if not given:
        raise TerrainError("no terrain file given: name at least one GeoTIFF, HGT or DTED file")
    paths = [Path(p) for p in given]
    tiles = [_read(path) for path in paths]
    checksum = 0
    for path in paths:
        checksum = zlib.crc32(path.read_bytes(), checksum)
    grid = _mosaic(tiles, paths)
    return Terrain(grid._replace(ceiling_m=ceilings(grid.height_m)), paths, f"{checksum:08x}")


def _read(path: Path) -> Grid:
    try:
        if not path.is_file():
            raise TerrainError(f"terrain file {path} does not exist: check the path in the configuration or --dem")
        path.open("rb").close()
        with rasterio.open(path) as source:
            if source.crs is None:
                raise TerrainError(f"{path} has no coordinate reference system: assign one with gdal_edit.py -a_srs")
            if source.crs == WGS84:
                return _grid(source)
            # The warped raster has corners that the source does not reach: NaN, or they would read as 0 m.
            warp = {"crs": WGS84, "resampling": Resampling.bilinear, "nodata": math.nan, "dtype": "float32"}
            with WarpedVRT(source, **warp) as geographic:
                return _grid(geographic)
    except PermissionError as error:
        raise TerrainError(f"terrain file {path} may not be read: give this user the right to read it") from error
    except (RasterioError, OSError) as error:
        raise TerrainError(f"{path} cannot be read as terrain (GeoTIFF, HGT or DTED): {error}") from error


def _grid(source: rasterio.DatasetReader) -> Grid:
    if source.count != 1:
        raise TerrainError(f"{source.name} has {source.count} bands: a terrain file has one, of heights in metres")
    if min(source.shape) < 2:
        raise TerrainError(f"{source.name} has {source.height} x {source.width} posts: 2 x 2 are the least")
    height_m = source.read(1, masked=True).astype(np.float32).filled(np.nan)
    if np.any((height_m < LOWEST_M) | (height_m > HIGHEST_M)):
        extremes = f"{np.nanmin(height_m):.0f} to {np.nanmax(height_m):.0f}"
        raise TerrainError(f"{source.name} holds heights of {extremes} m: mark voids as nodata, convert to metres")
    t = source.transform
    if t.b or t.d or t.a <= 0 or t.e >= 0:
        raise TerrainError(f"{source.name} is not a north-up raster: warp it with gdalwarp")
    return Grid(height_m, t.f + t.e / 2, t.c + t.a / 2, -t.e, t.a)


def _mosaic(tiles: list[Grid], paths: list[Path]) -> Grid:
    first = tiles[0]
    if len(tiles) == 1:
        return first
    offsets = [_offset(tile, first, path) for tile, path in zip(tiles, paths, strict=True)]
    top, left = min(row for row, _ in offsets), min(column for _, column in offsets)
    corners = [(row - top, column - left) for row, column in offsets]
    rows = max(row + tile.height_m.shape[0] for (row, _), tile in zip(corners, tiles, strict=True))
    columns = max(column + tile.height_m.shape[1] for (_, column), tile in zip(corners, tiles, strict=True))
    if rows * columns > MOST_POSTS:
        raise TerrainError(f"the terrain files span {rows} x {columns} posts: name only those that the flight needs")
    height_m = np.full((rows, columns), np.nan, np.float32)
    for (row, column), tile in zip(corners, tiles, strict=True):
        place = height_m[row : row + tile.height_m.shape[0], column : column + tile.height_m.shape[1]]
        np.copyto(place, tile.height_m, where=np.isnan(place))
    north_deg, west_deg = first.north_deg - top * first.row_deg, first.west_deg + left * first.column_deg
    return Grid(height_m, north_deg, west_deg, first.row_deg, first.column_deg)


def _offset(tile: Grid, first: Grid, path: Path) -> tuple[int, int]:
    row = (first.north_deg - tile.north_deg) / first.row_deg
    column = (tile.west_deg - first.west_deg) / first.column_deg
    same_spacing = math.isclose(tile.row_deg, first.row_deg, rel_tol=1e-6) and math.isclose(
        tile.column_deg, first.column_deg, rel_tol=1e-6
    )
    if not same_spacing or max(abs(row - round(row)), abs(column - round(column))) > ALIGNMENT_POSTS:
        raise TerrainError(f"{path} is not on the grid of the first terrain file: warp it to that grid with gdalwarp")
    return round(row), round(column)


@njit(cache=True)
def sample(grid: Grid, latitude_deg: float, longitude_deg: float) -> float:
    """Bilinear height in metres; NaN where one of the four posts is void or the place is outside."""
    row = (grid.north_deg - latitude_deg) / grid.row_deg
    column = (longitude_deg - grid.west_deg) / grid.column_deg
    return bilinear(grid.height_m, row, column)


@njit(cache=True)
def bilinear(height_m: NDArray[np.float32], row: float, column: float) -> float:
    """Bilinear height in metres at a place in posts; NaN where one of the four is void or the place is outside."""
    i, j, south, east = locate(height_m, row, column)
    columns = np.uint32(height_m.shape[1])
    return blend(*corners(height_m.reshape(height_m.size), np.uint32(i * columns) + j, columns), south, east)


@njit(cache=True)
def locate(height_m: NDArray[np.float32], row: float, column: float) -> tuple[np.uint32, np.uint32, float, float]:
    """The post north-west of a place, and how far south and east of it the place lies, in posts; NaN outside.

    Without a branch, or a loop over places could not go four at a time. Any number, NaN too, gives a post that exists.
    """
    rows, columns = height_m.shape
    i, j = np.floor(_within(row, rows - 2.0)), np.floor(_within(column, columns - 2.0))
    inside = (row >= 0) & (row <= rows - 1) & (column >= 0) & (column <= columns - 1)
    return np.uint32(np.int32(i)), np.uint32(np.int32(j)), row - i if inside else math.nan, column - j


@njit(cache=True)
def _within(x: float, last: float) -> float:
    x = x if x > 0.0 else 0.0  # NaN becomes 0, where max would hand it on
    return x if x < last else last


@njit(cache=True)
def corners(flat_m: NDArray[np.float32], k: np.uint32, columns: np.uint32) -> tuple[np.complex64, np.complex64]:
    """Post k of all with its neighbour to the east, and those south of them: two numbers to move, not four."""
    one, m = np.uint32(1), k + columns
    return np.complex64(complex(flat_m[k], flat_m[k + one])), np.complex64(complex(flat_m[m], flat_m[m + one]))


@njit(cache=True)
def blend(upper_m: np.complex64, lower_m: np.complex64, south: float, east: float) -> float:
    """Bilinear height between the four `corners` of a place, in double precision."""
    upper, lower = np.float64(upper_m.real), np.float64(lower_m.real)
    upper += (upper_m.imag - upper) * east
    lower += (lower_m.imag - lower) * east
    return float(upper + (lower - upper) * south)


@njit(cache=True)
def _sample_all(grid: Grid, lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.float64]:
    out = np.empty(lat.size)
    for k in range(lat.size):
        out[k] = sample(grid, lat[k], lon[k])
    return out
