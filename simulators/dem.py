"""Heights from a terrain file (GeoTIFF, SRTM HGT, DTED), with noise on every post: stored terrain is not the ground."""

import math

import numpy as np
import pyproj
import rasterio
from numpy.typing import NDArray
from rasterio.windows import Window
from scipy import ndimage

from simulators import scenario

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

MARGIN_POSTS = 4
NOISE_STREAM = 1


def sample(settings: scenario.World, latitudes: Floats, longitudes: Floats, seed: int) -> Heights:
    """Heights in metres at positions (n, m) in degrees: a cubic spline through the file's posts and their noise.

    NaN wherever a void or the file's edge would take part bilinearly. Raises FileNotFoundError for a missing file.
    """
    if not settings.path.is_file():
        raise FileNotFoundError(
            f"no terrain file {settings.path}: give a path or one of {list(scenario.BUILT_IN_TERRAIN)}"
        )
    with rasterio.open(settings.path) as file:
        places = _posts(file, latitudes, longitudes)
        rows, columns = (_needed(axis, posts) for axis, posts in zip(places, file.shape, strict=True))
        window = Window.from_slices(rows, columns)
        band = file.read(1, window=window, masked=True) * file.scales[0] + file.offsets[0]
    places[0] -= rows.start
    places[1] -= columns.start
    known = ~np.ma.getmaskarray(band)
    noise = np.random.default_rng((seed, NOISE_STREAM)).normal(0.0, settings.post_noise_m, band.shape)
    posts = np.where(known, band.filled(0) + noise, np.mean(band) if known.any() else 0.0)
    heights = ndimage.map_coordinates(posts, places, np.float32, order=3, mode="mirror")
    if known.all() and _inside(places, band.shape):
        return np.asarray(heights, np.float32)
    share = ndimage.map_coordinates(known.astype(np.float32), places, order=1, cval=0.0)
    return np.where(share > 0.999, heights, np.float32(math.nan))


def _posts(file: rasterio.DatasetReader, latitudes: Floats, longitudes: Floats) -> Floats:
    """Rows and columns (2, n, m) of positions, counted in posts: a post lies in the centre of GDAL's pixel."""
    if file.crs is None:
        raise ValueError(f"{file.name} names no coordinate system: convert it to a GeoTIFF that does")
    x, y = longitudes, latitudes
    if file.crs.is_geographic:  # brought beside the file, which may count from -180 or from 0
        x = x - 360 * np.round((np.mean(x) - (file.bounds.left + file.bounds.right) / 2) / 360)
    else:
        x, y = pyproj.Transformer.from_crs("EPSG:4326", file.crs, always_xy=True).transform(x, y)
    to_pixels = ~file.transform
    rows = to_pixels.d * x + to_pixels.e * y + (to_pixels.f - 0.5)
    columns = to_pixels.a * x + to_pixels.b * y + (to_pixels.c - 0.5)
    return np.stack([rows, columns])


def _needed(places: Floats, posts: int) -> slice:
    """The posts of one axis that places touch, with a margin for the spline, cut to the file and never empty."""
    first = min(max(math.floor(places.min()) - MARGIN_POSTS, 0), posts - 1)
    last = min(max(math.ceil(places.max()) + MARGIN_POSTS, first), posts - 1)
    return slice(first, last + 1)


def _inside(places: Floats, shape: tuple[int, ...]) -> bool:
    return all(place.min() >= 0 and place.max() <= posts - 1 for place, posts in zip(places, shape, strict=True))
