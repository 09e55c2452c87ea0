"""Where on the ground a range bin of a radial lies: on the boresight, at its slant range over the stored terrain."""

import math

from numba import njit

from monitor.geodesy import Ray, along, ray
from monitor.prediction import Pointing
from monitor.terrain import Grid, sample

LOOKS = 5  # each brings a place nearer by the ground's slope times depth over distance, so that few are enough


@njit(cache=True)
def line(grid: Grid, pointing: Pointing, i: int) -> tuple[Ray, float]:
    """The geodesic below the boresight of radial i, and the height of the ground below the antenna."""
    latitude, longitude, height = pointing.latitude_deg[i], pointing.longitude_deg[i], pointing.height_m[i]
    below = sample(grid, latitude, longitude)
    if math.isnan(below):
        below = height
    return ray(latitude, longitude, (height + below) / 2, pointing.azimuth_rad[i]), below


@njit(cache=True)
def place(grid: Grid, track: Ray, height_m: float, ground_m: float, range_m: float) -> tuple[float, float, float]:
    """Latitude and longitude in degrees at a slant range in metres along a `line`, and the height of the ground there.

    `ground_m` is a guess of that height: of the bin before, or below the antenna. Where there is no stored ground the
    guess stands.
    """
    latitude, longitude = track.lat0, track.lon0
    for _ in range(LOOKS):
        square = range_m**2 - (height_m - ground_m) ** 2
        latitude, longitude = along(track, math.sqrt(max(square, 0.0)))
        found = sample(grid, latitude, longitude)
        if math.isnan(found) or abs(found - ground_m) < 1.0:
            break
        ground_m = found
    return latitude, longitude, ground_m
