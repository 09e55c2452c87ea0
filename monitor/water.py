"""Large water: still water returns as little as a shadow does, so that dark bins over it are no evidence of terrain.

Young, Uijt de Haag and Campbell (2004), section 4 (d). The water is drawn on the posts of the terrain, from rasters in
which every value but 0 is water and from GeoJSON polygons: on all of them at once, or on a piece of wide terrain when
it is needed.
"""

import json
import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import rasterio
from numba import njit
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError  # what GDAL says where rasterio has no error of its own for it
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.errors import CRSError, RasterioError
from rasterio.features import rasterize
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT
from rasterio.warp import transform_bounds, transform_geom

from monitor.geodesy import curvature_radii
from monitor.places import line, place
from monitor.prediction import Pointing
from monitor.shade import last_dark
from monitor.terrain import Extent, Grid, Terrain, WideTerrain
from monitor.terrain_files import TURN_DEG, WGS84

POLYGONS = (".geojson", ".json")
Draw = Callable[[Grid], NDArray[np.bool_]]  # which posts of a grid are water
AROUND = np.ones((3, 3), np.uint8)  # posts that touch at a corner are of one water


class WaterError(ValueError):
    """A water file that is missing, unreadable, without a place on Earth or polygons, or away from the terrain."""


class Water:
    """Large water on the posts of a terrain in memory. Made by `WaterFiles.on`."""

    def __init__(self, grid: Grid, wet: NDArray[np.bool_]) -> None:
        self.grid = grid
        self.wet = wet

    def below(self, found: NDArray[np.void], pointing: Pointing, bin_width_m: float) -> NDArray[np.bool_]:
        """Which shadows (k,) on radials (n,) have a dark bin whose centre lies over water, on the boresight."""
        return np.asarray(_below(self.grid, self.wet, pointing, bin_width_m, found))


class WaterFiles:
    """The water of some files, drawn on terrain and kept as long as that terrain is. Made by `open_water`."""

    def __init__(self, draws: dict[Path, Draw], minimum_km2: float, checksum: str) -> None:
        self._draws = draws
        self._minimum_km2 = minimum_km2
        self._drawn: WeakKeyDictionary[Terrain, Water] = WeakKeyDictionary()
        self.checksum = checksum

    def on(self, terrain: Terrain) -> Water:
        """The water on terrain in memory, without what is smaller there than the minimum.

        Raises WaterError, naming the file, for one that cannot be read any more.
        """
        water = self._drawn.get(terrain)
        if water is None:
            wet = np.zeros(terrain.grid.height_m.shape, bool)
            for path, draw in self._draws.items():
                with _told(path):
                    wet |= draw(terrain.grid)
            water = self._drawn[terrain] = Water(terrain.grid, _large(wet, terrain.grid, self._minimum_km2))
        return water

    def idle(self, terrain: Terrain) -> list[str]:
        """What to say of water that has no effect on terrain in memory; of other terrain it is not known."""
        if isinstance(terrain, WideTerrain) or self.on(terrain).wet.any():
            return []
        names = ", ".join(map(str, self._draws))
        return [f"no water of {self._minimum_km2:g} km2 or more lies on the terrain: {names} has no effect"]


def open_water(path_or_paths: Path | Sequence[Path], terrain: Terrain, minimum_km2: float) -> WaterFiles:
    """Read where the water of some files lies; what is smaller than `minimum_km2` on the terrain will be left out.

    It is drawn at once on terrain that is in memory. Raises WaterError, naming the file and the mend, for a file that
    is missing or cannot be read, has no coordinate reference system or no polygons, or lies outside the terrain.
    """
    paths = [path_or_paths] if isinstance(path_or_paths, Path) else list(path_or_paths)
    draws: dict[Path, Draw] = {}
    checksum = 0
    for path in paths:
        with _told(path):
            content = path.read_bytes()
            draws[path] = (_polygons if path.suffix.lower() in POLYGONS else _raster)(path, terrain.extent)
        checksum = zlib.crc32(content, checksum)
    water = WaterFiles(draws, minimum_km2, f"{checksum:08x}")
    if not isinstance(terrain, WideTerrain):
        water.on(terrain)
    return water


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except (RasterioError, CPLE_BaseError, OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        mend = "name a raster of one band or GeoJSON polygons"
        raise WaterError(f"water file {path} cannot be read as a raster or GeoJSON: {error}: {mend}") from error


def _raster(path: Path, extent: Extent) -> Draw:
    with rasterio.open(path) as source:
        if source.crs is None:
            raise WaterError(
                f"water file {path} has no coordinate reference system: assign one with gdal_edit.py -a_srs"
            )
        if source.count != 1:
            raise WaterError(
                f"water file {path} has {source.count} bands: one is needed, with 0 where there is no water"
            )
        turns_deg = _turns_deg(path, transform_bounds(source.crs, WGS84, *source.bounds), extent)

    def draw(grid: Grid) -> NDArray[np.bool_]:
        rows, columns = grid.height_m.shape
        wet = np.zeros((rows, columns), bool)
        for turn_deg in turns_deg:
            there = _transform(grid._replace(west_deg=grid.west_deg - turn_deg))
            warp = {"crs": WGS84, "transform": there, "width": columns, "height": rows}
            with rasterio.open(path) as source, WarpedVRT(source, **warp, resampling=Resampling.nearest) as posts:
                wet |= np.nan_to_num(posts.read(1, masked=True).filled(0)) != 0
        return wet

    return draw


def _polygons(path: Path, extent: Extent) -> Draw:
    document = json.loads(path.read_text("utf-8"))
    crs = _crs(path, document)
    found = [*_areas(document)]
    if not found:
        raise WaterError(f"water file {path} holds no polygons: draw the water as Polygon or MultiPolygon")
    if not all(_is_whole(shape) for shape in found):
        raise WaterError(f"water file {path} holds a polygon without closed rings of numbers: mend or remove it")
    shapes = found if crs == WGS84 else [part for shape in found for part in _areas(transform_geom(crs, WGS84, shape))]
    polygons = [_unwrapped(path, rings) for shape in shapes for rings in _parts(shape)]
    positions = np.concatenate([outer for outer, *_ in polygons])
    turns_deg = _turns_deg(path, (*positions.min(axis=0).tolist(), *positions.max(axis=0).tolist()), extent)
    shapes = [
        {"type": "Polygon", "coordinates": [np.add(ring, (turn_deg, 0)).tolist() for ring in rings]}
        for turn_deg in turns_deg
        for rings in polygons
    ]

    def draw(grid: Grid) -> NDArray[np.bool_]:
        return np.asarray(rasterize(shapes, grid.height_m.shape, transform=_transform(grid), dtype="uint8") > 0)

    return draw


def _crs(path: Path, document: Any) -> CRS:
    """WGS 84 as of RFC 7946, unless the member of GeoJSON 2008 names another."""
    member = document.get("crs") if isinstance(document, dict) else None
    if member is None:
        return WGS84
    try:
        return CRS.from_user_input(member["properties"]["name"])
    except (CRSError, KeyError, TypeError) as error:
        raise WaterError(f"water file {path} names no coordinate reference system that is known in its crs") from error


def _areas(item: Any) -> Iterator[dict[str, Any]]:
    """The polygons in a GeoJSON object, however it is built."""
    if not isinstance(item, dict):
        return
    if item.get("type") in ("Polygon", "MultiPolygon"):
        yield item
    yield from _areas(item.get("geometry"))
    for parts in (item.get("geometries"), item.get("features")):
        for part in parts if isinstance(parts, list) else ():
            yield from _areas(part)


def _parts(shape: dict[str, Any]) -> Any:
    """The polygons of a Polygon or MultiPolygon, each a list of rings."""
    return shape["coordinates"] if shape["type"] == "MultiPolygon" else [shape["coordinates"]]


def _is_whole(shape: dict[str, Any]) -> bool:
    """Whether every ring is four positions of finite numbers or more: GDAL takes the rest on trust, and may crash."""
    try:
        polygons = [[np.asarray(ring) for ring in part] for part in _parts(shape)]
    except (KeyError, TypeError, ValueError):
        return False
    rings = [ring for polygon in polygons for ring in polygon]
    numbers = (
        ring.dtype.kind in "if" and ring.ndim == 2 and ring.shape[0] >= 4 and ring.shape[1] >= 2 for ring in rings
    )
    return all(polygons) and bool(rings) and all(numbers) and all(np.isfinite(ring).all() for ring in rings)


def _transform(grid: Grid) -> Affine:
    """Of a raster whose pixel centres are the posts."""
    west_deg, north_deg = grid.west_deg - grid.column_deg / 2, grid.north_deg + grid.row_deg / 2
    return Affine(grid.column_deg, 0, west_deg, 0, -grid.row_deg, north_deg)


def _unwrapped(path: Path, rings: Any) -> list[NDArray[np.float64]]:
    """Rings (n, 2) of a polygon without breaks in longitude, the holes beside the outer one."""
    outer, *holes = [_without_breaks(path, np.asarray(ring, float)[:, :2]) for ring in rings]
    for hole in holes:
        hole[:, 0] += TURN_DEG * np.round((_middle_deg(outer) - _middle_deg(hole)) / TURN_DEG)
    return [outer, *holes]


def _without_breaks(path: Path, ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """The ring with the shorter way from each position to the next; a whole turn goes along a parallel, as written."""
    steps_deg = np.diff(ring[:, 0], append=ring[0, 0])
    turns = np.where(np.abs(steps_deg) == TURN_DEG, 0, np.round(steps_deg / TURN_DEG))
    if turns.sum():
        raise WaterError(f"water file {path} holds a ring around a pole: cut it at the date line (RFC 7946, 3.1.9)")
    ring[1:, 0] -= TURN_DEG * np.cumsum(turns[:-1])
    return ring


def _middle_deg(ring: NDArray[np.float64]) -> float:
    return float(ring[:, 0].min() + ring[:, 0].max()) / 2


def _turns_deg(path: Path, box: tuple[float, float, float, float], extent: Extent) -> list[float]:
    """By how many degrees, whole turns, what lies in a box is to be moved to lie on the terrain: mostly just 0.

    Terrain on both sides of the date line has two, since maps of water are cut there (RFC 7946, section 3.1.9).
    """
    west, south, east, north = box
    east += 0 if west <= east else TURN_DEG  # GDAL's word for what crosses the date line
    turns_deg = [
        turn_deg
        for turn_deg in TURN_DEG * np.arange(-2.0, 3.0)
        if west + turn_deg <= extent.east and east + turn_deg >= extent.west
    ]
    if not (turns_deg and south <= extent.north and north >= extent.south):
        raise WaterError(
            f"water file {path} lies outside the terrain: it reaches from {south:.3f} to {north:.3f} N and "
            f"{west:.3f} to {east:.3f} E; name only those that the flight needs, or mend its reference system"
        )
    return turns_deg


def _large(wet: NDArray[np.bool_], grid: Grid, minimum_km2: float) -> NDArray[np.bool_]:
    """The water of connected posts that together stand for at least so much ground."""
    from scipy.ndimage import label  # noqa: PLC0415 # only where there is water, as it takes its time

    numbers, count = label(wet, AROUND)
    latitudes = np.radians(grid.north_deg - np.arange(len(wet)) * grid.row_deg)
    radii = np.array([curvature_radii(latitude) for latitude in latitudes])
    post_km2 = radii.prod(axis=1) * np.cos(latitudes) * math.radians(grid.row_deg) * math.radians(grid.column_deg) / 1e6
    return np.asarray((_areas_km2(numbers, count, post_km2) >= minimum_km2)[numbers] & wet)


@njit(cache=True)
def _areas_km2(numbers, count, post_km2):  # type: ignore[no-untyped-def] # typed by _large; numpy would need 24 B a post
    area_km2 = np.zeros(count + 1)  # 0 numbers what is dry
    for i in range(numbers.shape[0]):
        for j in range(numbers.shape[1]):
            if numbers[i, j]:
                area_km2[numbers[i, j]] += post_km2[i]
    return area_km2


@njit(cache=True)
def _below(grid, wet, pointing, bin_width_m, found):  # type: ignore[no-untyped-def] # typed by Water.below
    over = np.zeros(found.size, np.bool_)
    for k in range(found.size):
        shadow = found[k]
        track, ground = line(grid, pointing, shadow.radial)
        height = pointing.height_m[shadow.radial]
        for j in range(shadow.front, last_dark(shadow)):  # bins front + 1 to the last dark one
            latitude, longitude, ground = place(grid, track, height, ground, (j + 0.5) * bin_width_m)
            row = round((grid.north_deg - latitude) / grid.row_deg)
            column = round((longitude - grid.west_deg) / grid.column_deg)
            if 0 <= row < wet.shape[0] and 0 <= column < wet.shape[1] and wet[row, column]:
                over[k] = True
                break
    return over
