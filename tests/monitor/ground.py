"""Made-up ground along a meridian, where the answers follow from a triangle."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pyproj import Geod

from monitor.prediction import Pointing
from monitor.terrain import Grid

SOUTH, WEST = 44.0, -72.0
ARC_SECOND = 1 / 3600
COLUMNS = 121


def northward(height_m: Callable[[NDArray[np.float64]], NDArray[np.float64]], rows: int = 1200) -> Grid:
    """Posts an arc-second apart from 44 N 72 W; `height_m` gives the height at a latitude."""
    latitude = SOUTH + np.arange(rows, dtype=np.float64)[::-1] * ARC_SECOND
    heights = np.repeat(height_m(latitude)[:, None], COLUMNS, axis=1).astype(np.float32)
    return Grid(heights, float(latitude[0]), WEST, ARC_SECOND, ARC_SECOND)


def plain(level_m: float = 0.0) -> Grid:
    return northward(lambda latitude: np.full(latitude.size, level_m))


LATITUDE, LONGITUDE = SOUTH + 10 * ARC_SECOND, WEST + COLUMNS // 2 * ARC_SECOND


def distance_m(latitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far north of the antenna's place below; negative to the south."""
    here = np.full(latitude.size, LATITUDE)
    meridian = np.full(latitude.size, LONGITUDE)
    _, _, distance = Geod(ellps="WGS84").inv(meridian, here, meridian, latitude)
    return np.asarray(distance) * np.sign(latitude - LATITUDE)


def post_m(number: int) -> float:
    """The distance of the post so many rows north of the antenna's place below."""
    return float(distance_m(np.array([LATITUDE + number * ARC_SECOND]))[0])


def mesa(first_m: float, last_m: float, top_m: float) -> Grid:
    """A table mountain with slopes of 45 degrees on a plain at 0 m; its top lies between two distances."""
    corners = [first_m - top_m, first_m, last_m, last_m + top_m]
    return northward(lambda latitude: np.interp(distance_m(latitude), corners, [0, top_m, top_m, 0]))


def looking_north(height_m: float, tilt_deg: float = 0.0) -> Pointing:
    one = np.ones(1)
    return Pointing(LATITUDE * one, LONGITUDE * one, height_m * one, 0 * one, np.radians(tilt_deg) * one)


def either_side(longitude_deg: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Longitudes as receivers have them, as files beyond the date line have them, and the other way round."""
    return [(longitude_deg + 180) % 360 - 180, longitude_deg % 360, longitude_deg % 360 - 360]
