"""Terrain files side by side: where the posts of each lie on the grid they share, and the heights of any part of it.

Posts are indexed by pixel *centres*: GDAL widens the bounds of HGT and DTED cells by half a post, so the centres are
the posts of the standard. Opening reads headers only, and no file stays open.

Longitudes rise without a break across the grid, beyond 180 degrees or below -180 where the files do so together: the
date line is a meridian like any other, and what looks a place up brings its longitude there (`Extent.framed`).
"""

import math
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from typing import NamedTuple

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError  # what GDAL says where rasterio has no error of its own for it
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.errors import RasterioError
from rasterio.vrt import WarpedVRT
from rasterio.warp import transform_bounds
from rasterio.windows import Window

WGS84 = CRS.from_epsg(4326)
WGS84_EASTWARD = CRS.from_string("+proj=longlat +datum=WGS84 +lon_wrap=180 +no_defs")  # of longitudes from 0 to 360
LOWEST_M, HIGHEST_M = -500.0, 9000.0  # no ground on Earth lies outside
TURN_DEG = 360.0
FINEST_DEG = 1e-9  # between posts: a tenth of a millimetre
ALIGNMENT_POSTS = 0.05  # files whose posts miss a common grid by more are refused: resampling is not ours to hide
POSTS_AT_ONCE = 40_000_000  # of a file: what is read is a few times as large as what becomes of it
METRES = {"", "m", "metre", "metres", "meter", "meters"}  # a band without a unit is in metres
FOOT_M = 0.3048  # the survey foot's too, to 2 cm in 9 km
SAMPLE_BYTES, SAMPLE_EVERY = 4096, 1 << 20
BEYOND_RING_DEG = 5.0  # at 70 degrees of latitude the longest range spans less


class TerrainError(ValueError):
    """A terrain file that is missing, unreadable, without a place on Earth, or not on the grid of its neighbours."""


class Sheet(NamedTuple):
    """The posts of a file: their number, the north-western one in degrees, and the degrees between them."""

    rows: int
    columns: int
    north_deg: float
    west_deg: float
    row_deg: float
    column_deg: float


class Part(NamedTuple):
    """Rows `top` to `bottom` - 1 and columns `left` to `right` - 1 of the common grid."""

    top: int
    left: int
    bottom: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.bottom - self.top, self.right - self.left

    def common(self, other: "Part") -> "Part":
        """What lies in both; of no or negative rows or columns where nothing does."""
        corner = max(self.top, other.top), max(self.left, other.left)
        return Part(*corner, min(self.bottom, other.bottom), min(self.right, other.right))

    def eastward(self, columns: int) -> "Part":
        """As many rows and columns so far to the east."""
        return self._replace(left=self.left + columns, right=self.right + columns)


class TerrainFiles:
    """Files on one grid. Raises TerrainError, naming the file and the mend, for one that is not, or is no terrain."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)
        found = [_header(path) for path in paths]
        sheets = _in_one_run(found)
        first = sheets[0]
        offsets = [_offset(sheet, first, path) for sheet, path in zip(sheets, paths, strict=True)]
        top, left = min(row for row, _ in offsets), min(column for _, column in offsets)
        parts = [
            Part(row - top, column - left, row - top + sheet.rows, column - left + sheet.columns)
            for (row, column), sheet in zip(offsets, sheets, strict=True)
        ]
        rows, columns = max(part.bottom for part in parts), max(part.right for part in parts)
        beyond = _beyond_ring(columns, first.column_deg)
        north_deg, west_deg = first.north_deg - top * first.row_deg, first.west_deg + (left - beyond) * first.column_deg
        self.whole = Sheet(rows, columns + 2 * beyond, north_deg, west_deg, first.row_deg, first.column_deg)
        turn = round(TURN_DEG / first.column_deg)
        self._laid = [
            (path, sheet, part.eastward(beyond + turns * turn))
            for turns in ((0, -1, 1) if beyond else (0,))
            for path, sheet, part in zip(paths, found, parts, strict=True)
        ]

    def heights_m(self, part: Part) -> NDArray[np.float32]:
        """Heights of a part in metres, NaN where void or in no file; of overlapping files the first with a height wins.

        Raises TerrainError, naming the file and the mend, for one that cannot be read, has heights that no ground has,
        or is not what it was when it was opened.
        """
        height_m = np.full(part.shape, np.nan, np.float32)
        for path, sheet, place in self._laid:
            top, left, bottom, right = part.common(place)
            if top >= bottom or left >= right:
                continue
            ours = height_m[top - part.top : bottom - part.top, left - part.left : right - part.left]
            step = max(1, POSTS_AT_ONCE // (right - left))
            with _opened(path) as source:
                if _sheet(source) != sheet:
                    raise TerrainError(f"{path} has other posts than when it was opened: start anew")
                for row in range(0, bottom - top, step):
                    rows = ours[row : row + step]
                    window = Window(left - place.left, top - place.top + row, rows.shape[1], rows.shape[0])
                    np.copyto(rows, _heights_m(source, window), where=np.isnan(rows))
        return height_m

    def checksum(self) -> str:
        """CRC-32 of all bytes of the files, in hexadecimal."""
        checksum = 0
        for path in self.paths:
            checksum = zlib.crc32(path.read_bytes(), checksum)
        return f"{checksum:08x}"

    def sampled_checksum(self) -> str:
        """CRC-32 of each file's size (8 bytes, the least first) and the first 4 KiB of each MiB of it, in turn."""
        checksum = 0
        for path in self.paths:
            size = path.stat().st_size
            checksum = zlib.crc32(size.to_bytes(8, "little"), checksum)
            with path.open("rb", buffering=0) as file:
                for at in range(0, size, SAMPLE_EVERY):
                    file.seek(at)
                    checksum = zlib.crc32(file.read(SAMPLE_BYTES), checksum)
        return f"{checksum:08x}"


@contextmanager
def _opened(path: Path) -> Iterator[rasterio.DatasetReader]:
    """A file in degrees, for as long as it is read."""
    try:
        if path.is_dir():
            raise TerrainError(f"terrain {path} is a directory: name the files in it, one after the other")
        if not path.is_file():
            raise TerrainError(f"terrain file {path} does not exist: check the path in the configuration or --dem")
        path.open("rb").close()
        with rasterio.open(path) as source:
            _check_unit(path, source)
            if source.crs is None:
                raise TerrainError(f"{path} has no coordinate reference system: assign one with gdal_edit.py -a_srs")
            if source.crs == WGS84:
                yield source
                return
            west, _, east, _ = transform_bounds(source.crs, WGS84, *source.bounds)
            _check_surface(path, source.crs)
            crs = WGS84 if west <= east else WGS84_EASTWARD  # GDAL's word for a file on both sides of the date line
            # The warped raster has corners that the source does not reach: NaN, or they would read as 0 m.
            warp = {"crs": crs, "resampling": Resampling.bilinear, "nodata": math.nan, "dtype": "float32"}
            with WarpedVRT(source, **warp) as geographic:
                yield geographic
    except CPLE_BaseError as error:
        nowhere = f"{path} has a coordinate reference system that is of no place on Earth"
        raise TerrainError(f"{nowhere}: assign one with gdal_edit.py -a_srs") from error
    except PermissionError as error:
        raise TerrainError(f"terrain file {path} may not be read: give this user the right to read it") from error
    except (RasterioError, OSError) as error:
        mend = "get it anew, whole, or convert it with gdal_translate"
        raise TerrainError(f"{path} cannot be read as terrain (GeoTIFF, HGT or DTED): {error}: {mend}") from error


def _check_unit(path: Path, source: rasterio.DatasetReader) -> None:
    """GDAL's unit of the band, or that of the vertical axis of a compound reference system where a band has none."""
    unit, scale, offset = source.units[0] or "", source.scales[0], source.offsets[0]
    if unit.strip().lower() in METRES:
        return
    mend = "convert its heights"
    if any(name in unit.lower() for name in ("ft", "foot", "feet")):
        at_0_m, at_1_m = offset * FOOT_M, (offset + scale) * FOOT_M
        scale = f"-scale 0 1 {at_0_m:.9g} {at_1_m:.9g} -a_scale 1 -a_offset 0"
        mend = (
            f"gdal_translate -ot Float32 {scale} {quote(str(path))} metres.tif, then gdal_edit.py -units m metres.tif"
        )
    raise TerrainError(f"{path} has heights in {unit!r}, and metres are needed: {mend}")


def _check_surface(path: Path, crs: CRS) -> None:
    """A reference system with a third axis of its own has heights above the ellipsoid there."""
    if len(crs.to_dict(projjson=True).get("coordinate_system", {}).get("axis", ())) > 2:
        mend = "gdalwarp -t_srs EPSG:4326+5773 makes them, if PROJ has the geoid's grid us_nga_egm96_15.tif"
        raise TerrainError(f"{path} has heights above the ellipsoid, and those above mean sea level are needed: {mend}")


def _header(path: Path) -> Sheet:
    with _opened(path) as source:
        return _sheet(source)


def _sheet(source: rasterio.DatasetReader) -> Sheet:
    if source.count != 1:
        raise TerrainError(f"{source.name} has {source.count} bands: a terrain file has one, of heights in metres")
    if min(source.shape) < 2:
        raise TerrainError(f"{source.name} has {source.height} x {source.width} posts: 2 x 2 are the least")
    t = source.transform
    if t.b or t.d or t.a <= 0 or t.e >= 0:
        raise TerrainError(f"{source.name} is not a north-up raster: warp it with gdalwarp")
    north, south, east = t.f, t.f + t.e * source.height, t.c + t.a * source.width
    on_earth = north <= 90 - t.e and south >= -90 + t.e and abs(t.c) <= TURN_DEG and east <= 2 * TURN_DEG
    if not (on_earth and min(t.a, -t.e) >= FINEST_DEG):
        raise TerrainError(f"{source.name} has posts at no latitude or longitude: mend it with gdal_edit.py -a_ullr")
    return Sheet(source.height, source.width, t.f + t.e / 2, t.c + t.a / 2, -t.e, t.a)


def _heights_m(source: rasterio.DatasetReader, window: Window) -> NDArray[np.float32]:
    height_m = np.asarray(source.read(1, window=window, masked=True).astype(np.float32).filled(np.nan))
    scale, offset = source.scales[0], source.offsets[0]  # which read does not apply, nor does a warp
    if (scale, offset) != (1, 0):
        height_m = height_m * np.float32(scale) + np.float32(offset)
    if np.any((height_m < LOWEST_M) | (height_m > HIGHEST_M)):
        extremes = f"{np.nanmin(height_m):.0f} to {np.nanmax(height_m):.0f}"
        raise TerrainError(f"{source.name} holds heights of {extremes} m: mark voids as nodata, convert to metres")
    return height_m


def _offset(sheet: Sheet, first: Sheet, path: Path) -> tuple[int, int]:
    row = (first.north_deg - sheet.north_deg) / first.row_deg
    column = (sheet.west_deg - first.west_deg) / first.column_deg
    same_spacing = math.isclose(sheet.row_deg, first.row_deg, rel_tol=1e-6) and math.isclose(
        sheet.column_deg, first.column_deg, rel_tol=1e-6
    )
    if not same_spacing or max(abs(row - round(row)), abs(column - round(column))) > ALIGNMENT_POSTS:
        raise TerrainError(f"{path} is not on the grid of the first terrain file: warp it to that grid with gdalwarp")
    return round(row), round(column)


def _in_one_run(sheets: Sequence[Sheet]) -> list[Sheet]:
    """The same sheets, turned about the Earth so that they span the fewest degrees together.

    They begin behind the widest gap between them, in whatever order they are named; those that need no turn stay as
    they are to the bit.
    """
    west_deg = np.array([sheet.west_deg for sheet in sheets])
    width_deg = np.array([sheet.columns * sheet.column_deg for sheet in sheets])
    post_deg = sheets[0].column_deg  # by half of which rounding cannot move a file

    def turns(start_deg: float) -> NDArray[np.float64]:
        return np.floor((west_deg - start_deg + post_deg / 2) / TURN_DEG)

    def span_posts(start_deg: float) -> int:
        return round(float(np.max(west_deg - TURN_DEG * turns(start_deg) + width_deg) - start_deg) / post_deg)

    begins = min(np.unique(west_deg).tolist(), key=span_posts)
    moved_deg = west_deg - TURN_DEG * turns(begins)
    return [sheet._replace(west_deg=west) for sheet, west in zip(sheets, moved_deg.tolist(), strict=True)]


def _beyond_ring(columns: int, column_deg: float) -> int:
    """How many columns are laid once more beyond either end of files that go all round the Earth; of others none."""
    turn = TURN_DEG / column_deg
    is_ring = columns >= round(turn) and abs(turn - round(turn)) < ALIGNMENT_POSTS
    return math.ceil(BEYOND_RING_DEG / column_deg) if is_ring else 0
