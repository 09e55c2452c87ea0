"""Where a point on a radial lies: geodesic rays as cubics, and the antenna's place from a lever arm.

A radial's bins all lie on one geodesic, so latitude and longitude along it are written once as cubic polynomials of the
ground distance and evaluated by Horner's rule for every bin. The coefficients are the Taylor series of the geodesic
equations  phi' = cos(alpha)/M,  lambda' = sin(alpha)/(N cos(phi)),  alpha' = tan(phi) sin(alpha)/N  (WGS 84), where the
third order neglects the ellipticity. Against pyproj the error stays below a tenth of a range bin at range settings up
to `LONGEST_RANGE_NM` within `HIGHEST_LATITUDE_DEG` of the equator; beyond, the monitor declines.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)
NM_M = 1852.0
FT_M = 0.3048
KT_M_S = NM_M / 3600
LONGEST_RANGE_NM = 80.0
HIGHEST_LATITUDE_DEG = 70.0


class Ray(NamedTuple):
    """Latitude and longitude in degrees as cubics of the horizontal distance s in metres from the origin."""

    lat0: float
    lat1: float
    lat2: float
    lat3: float
    lon0: float
    lon1: float
    lon2: float
    lon3: float


@njit(cache=True, inline="always")
def curvature_radii(latitude_rad: float) -> tuple[float, float]:
    """Radii of curvature in the meridian (M) and in the prime vertical (N), metres."""
    w2 = 1 - ECCENTRICITY_SQUARED * math.sin(latitude_rad) ** 2
    return SEMI_MAJOR_M * (1 - ECCENTRICITY_SQUARED) / w2**1.5, SEMI_MAJOR_M / math.sqrt(w2)


@njit(cache=True)
def ray(latitude_deg: float, longitude_deg: float, height_m: float, azimuth_rad: float) -> Ray:
    """The geodesic that leaves a point at a true azimuth; distances are horizontal, measured at `height_m`."""
    phi = math.radians(latitude_deg)
    meridian, prime = curvature_radii(phi)
    tan_phi, cos_phi = math.tan(phi), math.cos(phi)
    sin_a, cos_a = math.sin(azimuth_rad), math.cos(azimuth_rad)
    w2 = 1 - ECCENTRICITY_SQUARED * math.sin(phi) ** 2
    meridian_slope = 3 * ECCENTRICITY_SQUARED * math.sin(phi) * cos_phi / w2  # (dM/dphi) / M

    lat1 = cos_a / meridian
    lat2 = -(sin_a**2 * tan_phi / (meridian * prime) + meridian_slope * lat1**2) / 2
    lat3 = -(sin_a**2) * cos_a * (1 + 3 * tan_phi**2) / (6 * meridian * prime**2)
    lon1 = sin_a / (prime * cos_phi)
    lon2 = sin_a * cos_a * tan_phi * (1 / prime + 1 / meridian) / (2 * prime * cos_phi)
    lon2 -= lon1 * lat1 * ECCENTRICITY_SQUARED * math.sin(phi) * cos_phi / w2 / 2  # dN/dphi
    lon3 = sin_a * (cos_a**2 * (1 + 3 * tan_phi**2) - sin_a**2 * tan_phi**2) / (3 * prime**3 * cos_phi)

    shrink = prime / (prime + height_m)  # a horizontal metre at height spans less arc on the ellipsoid
    deg1 = math.degrees(shrink)
    deg2 = deg1 * shrink
    deg3 = deg2 * shrink
    return Ray(
        latitude_deg, lat1 * deg1, lat2 * deg2, lat3 * deg3, longitude_deg, lon1 * deg1, lon2 * deg2, lon3 * deg3
    )


@njit(cache=True)
def along(r: Ray, s: float) -> tuple[float, float]:
    """Latitude and longitude in degrees at the horizontal distance s in metres."""
    return (
        r.lat0 + s * (r.lat1 + s * (r.lat2 + s * r.lat3)),
        r.lon0 + s * (r.lon1 + s * (r.lon2 + s * r.lon3)),
    )


def body_to_enu(
    forward: NDArray[np.float64],
    right: NDArray[np.float64],
    down: NDArray[np.float64],
    roll_deg: NDArray[np.float64],
    pitch_deg: NDArray[np.float64],
    heading_deg: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Rotate body vectors (forward, right, down) into east, north, up: roll, then pitch, then true heading."""
    roll, pitch, heading = np.radians(roll_deg), np.radians(pitch_deg), np.radians(heading_deg)
    right_level = right * np.cos(roll) - down * np.sin(roll)
    down_roll = right * np.sin(roll) + down * np.cos(roll)
    forward_level = forward * np.cos(pitch) + down_roll * np.sin(pitch)
    down_level = -forward * np.sin(pitch) + down_roll * np.cos(pitch)
    east = forward_level * np.sin(heading) + right_level * np.cos(heading)
    north = forward_level * np.cos(heading) - right_level * np.sin(heading)
    return east, north, -down_level


@njit(cache=True)
def displace(
    latitude_deg: NDArray[np.float64],
    longitude_deg: NDArray[np.float64],
    height_m: NDArray[np.float64],
    east_m: NDArray[np.float64],
    north_m: NDArray[np.float64],
    up_m: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions (n,), degrees and metres, moved by local east, north and up metres (the lever arm).

    Back from Earth-centred coordinates by Bowring, Survey Review 181 (1976) and 218 (1985): to 1e-9 degrees and 0.1 mm
    at the heights of aircraft.
    """
    latitude, longitude, height = np.empty(height_m.size), np.empty(height_m.size), np.empty(height_m.size)
    for k in range(height_m.size):
        phi, lam = math.radians(latitude_deg[k]), math.radians(longitude_deg[k])
        _, prime = curvature_radii(phi)
        rise = up_m[k] + height_m[k]
        outward = (prime + rise) * math.cos(phi) - north_m[k] * math.sin(phi)  # from the axis, in the first meridian
        x = outward * math.cos(lam) - east_m[k] * math.sin(lam)
        y = outward * math.sin(lam) + east_m[k] * math.cos(lam)
        z = (prime * (1 - ECCENTRICITY_SQUARED) + rise) * math.sin(phi) + north_m[k] * math.cos(phi)
        p = math.hypot(x, y)
        beta = math.atan2(z, p * (1 - FLATTENING))
        polar_m = ECCENTRICITY_SQUARED * SEMI_MAJOR_M / (1 - FLATTENING)  # e'^2 b
        phi = math.atan2(
            z + polar_m * math.sin(beta) ** 3, p - ECCENTRICITY_SQUARED * SEMI_MAJOR_M * math.cos(beta) ** 3
        )
        _, prime = curvature_radii(phi)
        latitude[k], longitude[k] = math.degrees(phi), math.degrees(math.atan2(y, x))
        height[k] = p * math.cos(phi) + z * math.sin(phi) - SEMI_MAJOR_M**2 / prime
    return latitude, longitude, height
