"""The terrain store: GeoTIFF, SRTM HGT and DTED files as one grid of posts, sampled bilinearly.

Voids become NaN before anything interpolates, so a void post spoils the four cells around it and nothing else. What is
too large to be held as a whole is read in pieces, where it is needed.
"""

import math
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from monitor.ceiling import ceilings
from monitor.geodesy import curvature_radii
from monitor.terrain_files import TURN_DEG, Part, TerrainError, TerrainFiles

Real = Any  # of single or double precision

WHOLE_POSTS = 40_000_000  # 160 MB; up to here files are held as a whole
KEPT_POSTS = 100_000_000  # 400 MB of pieces that are kept beside the newest
MOST_POSTS = 400_000_000  # 1.6 GB; what is needed at once must not fill the memory
BLOCK_DEG = 0.5  # pieces end on multiples of it
BEYOND = 1.01  # of the reach, for what the radii of curvature change over it
NO_CEILING = np.empty((0, 0), np.float32)


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

    def with_heights(self, height_m: NDArray[np.float32]) -> "Grid":
        """Other heights in the same places, of which no ceilings are known."""
        return self._replace(height_m=height_m, ceiling_m=NO_CEILING)


class Extent(NamedTuple):
    """Latitudes and longitudes of the outermost posts, degrees; `west` is below `east` across the date line too."""

    south: float
    north: float
    west: float
    east: float

    @classmethod
    def of(cls, rows: int, columns: int, north_deg: float, west_deg: float, row_deg: float, column_deg: float) -> Self:
        """Of so many posts from the north-western one on."""
        return cls(north_deg - (rows - 1) * row_deg, north_deg, west_deg, west_deg + (columns - 1) * column_deg)

    def framed(self, longitude_deg: ArrayLike) -> NDArray[np.float64]:
        """The same longitudes, any shape, on one scale with `west` and `east`."""
        return beside((self.west + self.east) / 2, longitude_deg)


def beside(meridian_deg: float, longitude_deg: ArrayLike) -> NDArray[np.float64]:
    """The same longitudes, any shape, within half a turn of a meridian; those that are there stay so to the bit.

    What is no longitude, as NaN or 1e300, does not become one: no longitude needs more than two turns.
    """
    given = np.asarray(longitude_deg, float)
    turns = np.rint((meridian_deg - given) / TURN_DEG)
    return np.asarray(given + TURN_DEG * np.minimum(np.maximum(turns, -2), 2))


class Terrain:
    """Stored terrain heights in memory. `open_terrain` makes it of files that are small enough."""

    def __init__(self, grid: Grid, paths: Sequence[Path], checksum: str) -> None:
        self._grid = grid
        rows, columns = grid.height_m.shape
        self.extent = Extent.of(rows, columns, *grid[1:5])
        self.paths = tuple(paths)
        self.checksum = checksum

    @property
    def grid(self) -> Grid:
        """All posts."""
        return self._grid

    def around(
        self,
        latitude_deg: NDArray[np.float64],  # noqa: ARG002 # as WideTerrain's
        longitude_deg: NDArray[np.float64],  # noqa: ARG002
        reach_m: float,  # noqa: ARG002
    ) -> "Terrain":
        """Terrain in memory that holds all ground within reach of any of these places (n,)."""
        return self

    def elevation(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> NDArray[np.float64]:
        """Heights in metres at WGS 84 degrees, any shape; NaN where a needed post is void or outside the files."""
        lat, lon = np.broadcast_arrays(np.asarray(latitude_deg, float), self.extent.framed(longitude_deg))
        return self._elevation(lat.ravel(), lon.ravel()).reshape(lat.shape)

    def _elevation(self, lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(_sample_all(self._grid, lat, lon))


class WideTerrain(Terrain):
    """Stored terrain of which only pieces are in memory: those last used, up to `KEPT_POSTS`, or one larger one.

    `pieces` are those, the last used at the end.
    What it says raises TerrainError, naming the file and the mend, where one cannot be read any more.
    """

    def __init__(self, files: TerrainFiles, checksum: str) -> None:
        self._files = files
        self.pieces: OrderedDict[Part, Terrain] = OrderedDict()  # the last used at the end
        self.extent = Extent.of(*files.whole)
        self.paths = files.paths
        self.checksum = checksum

    @property
    def grid(self) -> Grid:
        """All posts, as far as there is memory for them; a TerrainError beyond."""
        return self._piece(Part(0, 0, self._files.whole.rows, self._files.whole.columns)).grid

    def around(self, latitude_deg: NDArray[np.float64], longitude_deg: NDArray[np.float64], reach_m: float) -> Terrain:
        """A piece that holds all ground within reach of any of these places (n,).

        It ends on multiples of `BLOCK_DEG`, or where the files do: which one it is depends on nothing but the places
        and the reach, so that a replay looks at the same posts in the same order.
        """
        lon = beside(float(self.extent.framed(longitude_deg.flat[0])), longitude_deg)
        south, north, west, east = (
            float(end) for end in (latitude_deg.min(), latitude_deg.max(), lon.min(), lon.max())
        )
        high = BEYOND * math.degrees(reach_m / curvature_radii(math.radians(south))[0])
        farthest_deg = min(max(abs(south), abs(north)) + high, 89.0)
        wide = BEYOND * math.degrees(reach_m / math.cos(math.radians(farthest_deg)) / curvature_radii(0.0)[1])
        rows, columns, north_deg, west_deg, row_deg, column_deg = self._files.whole
        top, bottom = _cut(north_deg - _up(north + high), north_deg - _down(south - high), row_deg, rows)
        left, right = _cut(_down(west - wide) - west_deg, _up(east + wide) - west_deg, column_deg, columns)
        return self._piece(Part(top, left, bottom, right))

    def _piece(self, part: Part) -> Terrain:
        piece = self.pieces.pop(part, None) or self._read(part)
        self.pieces[part] = piece
        return piece

    def _read(self, part: Part) -> Terrain:
        rows, columns = part.shape
        if rows * columns > MOST_POSTS:
            raise TerrainError(
                f"the terrain that is needed at once spans {rows} x {columns} posts, more than there is memory for "
                f"({MOST_POSTS}): choose a shorter range, or terrain with fewer posts to a degree"
            )
        while self.pieces and self.held_posts + rows * columns > KEPT_POSTS:
            self.pieces.popitem(last=False)
        _, _, north_deg, west_deg, row_deg, column_deg = self._files.whole
        height_m = self._files.heights_m(part)
        corner = north_deg - part.top * row_deg, west_deg + part.left * column_deg
        return Terrain(Grid(height_m, *corner, row_deg, column_deg, ceilings(height_m)), self.paths, self.checksum)

    @property
    def held_posts(self) -> int:
        """How many posts are in memory."""
        return sum(piece.grid.height_m.size for piece in self.pieces.values())

    def _elevation(self, lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.full(lat.size, np.nan)
        south, north, west, east = self.extent
        known = np.flatnonzero((lat >= south) & (lat <= north) & (lon >= west) & (lon <= east))
        blocks = np.floor(np.stack([lat[known], lon[known]], axis=1) / BLOCK_DEG)
        _, block = np.unique(blocks, axis=0, return_inverse=True)
        order = np.argsort(block, kind="stable")
        for some in np.split(known[order], np.flatnonzero(np.diff(block[order])) + 1):
            if some.size:
                out[some] = self.around(lat[some], lon[some], 0.0).elevation(lat[some], lon[some])
        return out


def _down(degrees: float) -> float:
    return math.floor(degrees / BLOCK_DEG) * BLOCK_DEG


def _up(degrees: float) -> float:
    return math.ceil(degrees / BLOCK_DEG) * BLOCK_DEG


def _cut(begin_deg: float, end_deg: float, step_deg: float, posts: int) -> tuple[int, int]:
    """The first post of an axis that is needed and the one behind the last: two that exist, even if none is."""
    first = min(max(math.floor(begin_deg / step_deg), 0), posts - 2)
    return first, max(min(math.ceil(end_deg / step_deg) + 1, posts), first + 2)


def open_terrain(path_or_paths: str | Path | Sequence[str | Path]) -> Terrain:
    """Open one terrain file or mosaic several that share a post spacing.

    Of more than `WHOLE_POSTS` posts, gaps between files included, headers are read and the heights where they are
    needed. Raises TerrainError, naming the file and the mend, for a file that is missing, cannot be read, has no
    coordinate reference system, or does not lie on the same grid as the first. Of overlapping files the first with a
    height wins.
    """
    given = [path_or_paths] if isinstance(path_or_paths, str | Path) else list(path_or_paths)
    if not given:
        raise TerrainError("no terrain file given: name at least one GeoTIFF, HGT or DTED file")
    files = TerrainFiles([Path(p) for p in given])
    if files.whole.rows * files.whole.columns > WHOLE_POSTS:
        return WideTerrain(files, files.sampled_checksum())
    height_m = files.heights_m(Part(0, 0, files.whole.rows, files.whole.columns))
    return Terrain(Grid(height_m, *files.whole[2:], ceilings(height_m)), files.paths, files.checksum())


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
    height: float = blend(*corners(height_m.reshape(height_m.size), np.uint32(i * columns) + j, columns), south, east)
    return height


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
def blend(upper_m: np.complex64, lower_m: np.complex64, south: Real, east: Real) -> Real:
    """Bilinear height between the four `corners` of a place, in the place's precision."""
    upper = upper_m.real + (upper_m.imag - upper_m.real) * east
    lower = lower_m.real + (lower_m.imag - lower_m.real) * east
    return upper + (lower - upper) * south


@njit(cache=True)
def _sample_all(grid: Grid, lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.float64]:
    out = np.empty(lat.size)
    for k in range(lat.size):
        out[k] = sample(grid, lat[k], lon[k])
    return out
