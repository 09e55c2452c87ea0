"""The ground: a terrain file resampled to metres about the flight, roughened by what the file does not know."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from simulators import dem, scenario

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

LATTICE_M = 500.0  # geodetic coordinates bend by 5 mm over this distance, so they are interpolated linearly within it


@dataclass(frozen=True)
class Ground:
    """Heights above mean sea level on a metric raster, row 0 in the south, column 0 in the west; NaN is unknown ground.

    East and north are metres from `projection`'s centre (azimuthal equidistant); the raster starts at `west`, `south`.
    """

    heights: Heights
    west: float
    south: float
    spacing: float
    projection: pyproj.Proj

    def locate(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> tuple[Floats, Floats]:
        """East and north (n,) in metres of geodetic positions (n,)."""
        east, north = self.projection(np.asarray(longitude_deg), np.asarray(latitude_deg))
        return np.asarray(east, np.float64), np.asarray(north, np.float64)

    def grid_bearing(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike, azimuth_deg: ArrayLike) -> Floats:
        """Bearings (n,) on the raster, clockwise from its north, of true azimuths (n,) at those positions."""
        if not np.size(azimuth_deg):
            return np.zeros(0)  # the projection library refuses to be asked for nothing
        factors = self.projection.get_factors(np.asarray(longitude_deg), np.asarray(latitude_deg))
        return np.asarray(np.asarray(azimuth_deg) - factors.meridian_convergence, np.float64)

    def elevation(self, east: ArrayLike, north: ArrayLike) -> Floats:
        """Height (n,) of the ground in metres, bilinear; NaN where unknown or off the raster."""
        rows = (np.asarray(north) - self.south) / self.spacing
        columns = (np.asarray(east) - self.west) / self.spacing
        found = ndimage.map_coordinates(self.heights, [rows, columns], np.float64, order=1, cval=math.nan)
        return np.asarray(found, np.float64)


def build(settings: scenario.World, latitude_deg: Floats, longitude_deg: Floats, reach_m: float, seed: int) -> Ground:
    """The ground within `reach_m` of a track (n,) given in degrees.

    Raises FileNotFoundError for a missing terrain file, and ValueError where the flight's radar would look at ground
    that the file does not hold, unless the settings say `incomplete`.
    """
    middle_deg = float(np.mean(longitude_deg))
    middle = pyproj.Proj(proj="aeqd", lat_0=float(np.mean(latitude_deg)), lon_0=middle_deg, ellps="WGS84")
    east, north = (np.asarray(axis) for axis in middle(longitude_deg, latitude_deg))
    eastings, northings = _axis(east, reach_m, settings.spacing_m), _axis(north, reach_m, settings.spacing_m)
    latitudes, longitudes = _geodetic(middle, middle_deg, eastings, northings)
    heights = dem.sample(settings, latitudes, longitudes, seed)
    ground = Ground(heights, float(eastings[0]), float(northings[0]), settings.spacing_m, middle)
    if not settings.incomplete:
        _refuse_unknown(ground, east, north, reach_m, settings.path)
    return ground


def _axis(track: Floats, reach_m: float, spacing: float) -> Floats:
    first, last = math.floor((track.min() - reach_m) / spacing), math.ceil((track.max() + reach_m) / spacing)
    return np.arange(first, last + 1) * spacing


def _geodetic(projection: pyproj.Proj, middle_deg: float, eastings: Floats, northings: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude of every raster point: projected on a wide lattice, linear in between."""
    (coarse_east, to_east), (coarse_north, to_north) = _hats(eastings), _hats(northings)
    longitude, latitude = projection(*np.meshgrid(coarse_east, coarse_north), inverse=True)
    longitude -= 360 * np.round((longitude - middle_deg) / 360)  # without a break at the date line
    return to_north @ latitude @ to_east.T, to_north @ longitude @ to_east.T


def _hats(axis: Floats) -> tuple[Floats, Floats]:
    """Lattice (m,) over an axis (n,), and the matrix (n, m) that interpolates from it linearly."""
    lattice = np.linspace(axis[0], axis[-1], math.ceil((axis[-1] - axis[0]) / LATTICE_M) + 1)
    distance = np.abs(axis[:, None] - lattice) / (lattice[1] - lattice[0])
    return lattice, np.maximum(0.0, 1.0 - distance)


def _refuse_unknown(ground: Ground, east: Floats, north: Floats, reach_m: float, path: Path) -> None:
    rows, columns = np.nonzero(np.isnan(ground.heights))
    x, y = ground.west + columns * ground.spacing, ground.south + rows * ground.spacing
    away = np.full(len(x), math.inf)
    for track_east, track_north in zip(east, north, strict=True):
        away = np.minimum(away, np.hypot(x - track_east, y - track_north))
    if np.any(away < reach_m):
        nearest = np.argmin(away)
        longitude, latitude = ground.projection(x[nearest], y[nearest], inverse=True)
        raise ValueError(
            f"{path.name} holds no ground at {latitude:.3f}, {longitude:.3f}, {away[nearest] / 1000:.1f} km from the "
            f"flight and within the radar's reach of {reach_m / 1000:.1f} km: fly elsewhere, shorten the range, "
            "or set world.incomplete = true to get no returns from there"
        )
