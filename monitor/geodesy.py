"""Where a point on a radial lies: geodesic rays as polynomials, and the antenna's place from a lever arm.

A radial's bins all lie on one geodesic, so latitude and longitude along it are written once as quintics of the ground
distance and evaluated by Horner's rule for every bin. Up to `LONGEST_RANGE_NM`, within `HIGHEST_LATITUDE_DEG` of the
equator, they lie within a millimetre of pyproj's and pymap3d's; beyond, the monitor declines.
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


# Where besides its start a ray's rates are found (Radau's nodes: a polynomial through them errs little up to the
# longest range), and what makes coefficients of the second to the fifth power of how those rates differ from the first.
NODES = 4
_NODES_M = LONGEST_RANGE_NM * NM_M * (1 - np.cos(2 * np.pi * np.arange(1, NODES + 1) / (2 * NODES + 1))) / 2
_INTEGRAL = np.linalg.inv(_NODES_M[:, None] ** np.arange(1, NODES + 1)) / np.arange(2, NODES + 2)[:, None]


class Ray(NamedTuple):
    """Latitude and longitude in degrees as quintics of the horizontal distance s in metres from the origin."""

    lat0: float
    lat1: float
    lat2: float
    lat3: float
    lat4: float
    lat5: float
    lon0: float
    lon1: float
    lon2: float
    lon3: float
    lon4: float
    lon5: float


@njit(cache=True, inline="always")
def curvature_radii(latitude_rad: float) -> tuple[float, float]:
    """Radii of curvature in the meridian (M) and in the prime vertical (N), metres."""
    w2 = 1 - ECCENTRICITY_SQUARED * math.sin(latitude_rad) ** 2
    prime = SEMI_MAJOR_M / math.sqrt(w2)
    return prime * (1 - ECCENTRICITY_SQUARED) / w2, prime


# Multiplications and additions as one instruction make up for what a quintic has more to do than a cubic; inlined, the
# sine of the latitude is taken once for a ray and for its caller.
@njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def ray(latitude_deg: float, longitude_deg: float, height_m: float, azimuth_rad: float) -> Ray:
    """The geodesic that leaves a point at a true azimuth, on the surface that lies `height_m` above the ellipsoid.

    On a surface of revolution (here of radii M + h and N + h) k = N cos(phi) sin(alpha) stays what it is (Clairaut), so
    that q = sin(phi) obeys  q'^2 = (1 - q^2 - k^2/N^2) / M^2,  a function of q^2, and hence  q'' = (A + B q^2) q.  B is
    of the order of the ellipticity, and what would follow moves no place by a tenth of a millimetre. Of such a swing
    80 NM are so short a part that its Taylor series ends with the fifth power, micrometres aside. With q, the rates
    phi' = q'/cos(phi)  and  lambda' = k / (N cos(phi))^2  are known wherever one likes; the polynomials are integrals
    of those through the rates at the start and at `NODES` more distances.
    """
    phi = math.radians(latitude_deg)
    meridian, prime = curvature_radii(phi)
    q, cos_phi = math.sin(phi), math.cos(phi)
    sin_a, cos_a = math.sin(azimuth_rad), math.cos(azimuth_rad)
    ellipticity = ECCENTRICITY_SQUARED / (1 - ECCENTRICITY_SQUARED * q**2)  # (2 dN/dq^2) / N
    turn = 1 / (meridian + height_m)
    m, n = meridian * turn, prime / (prime + height_m)
    pull = -(turn**2) * (1 - ellipticity * cos_phi**2 * (n * sin_a**2 - 3 * m * cos_a**2))  # A + B q^2
    b = 3 * m * ellipticity * (turn**2 * (1 - ellipticity * cos_phi**2) - pull)
    stiffness = pull + 2 * b * q**2  # A + 3 B q^2
    q1 = cos_phi * cos_a * turn
    q2 = pull * q / 2
    q3 = stiffness * q1 / 6
    q4 = (stiffness * q2 + 3 * b * q * q1**2) / 12
    q5 = (stiffness * q3 + b * q1 * (6 * q * q2 + q1**2)) / 20
    sideways = cos_phi * sin_a / (prime + height_m)  # k / N^2

    lat1, lon1 = cos_a * turn, sideways / cos_phi**2
    lat2 = lat3 = lat4 = lat5 = lon2 = lon3 = lon4 = lon5 = 0.0
    for k in range(NODES):
        s = _NODES_M[k]
        sine = q + s * (q1 + s * (q2 + s * (q3 + s * (q4 + s * q5))))
        slope = q1 + s * (2 * q2 + s * (3 * q3 + s * (4 * q4 + s * 5 * q5)))
        secant = 1 / math.sqrt(1 - sine**2)
        north = slope * secant - lat1
        east = sideways * (1 - n * ellipticity * (sine**2 - q**2)) * secant**2 - lon1
        lat2 += _INTEGRAL[0, k] * north
        lat3 += _INTEGRAL[1, k] * north
        lat4 += _INTEGRAL[2, k] * north
        lat5 += _INTEGRAL[3, k] * north
        lon2 += _INTEGRAL[0, k] * east
        lon3 += _INTEGRAL[1, k] * east
        lon4 += _INTEGRAL[2, k] * east
        lon5 += _INTEGRAL[3, k] * east
    d = math.degrees(1.0)
    return Ray(
        latitude_deg, lat1 * d, lat2 * d, lat3 * d, lat4 * d, lat5 * d,
        longitude_deg, lon1 * d, lon2 * d, lon3 * d, lon4 * d, lon5 * d,
    )  # fmt: skip


@njit(cache=True, fastmath={"contract"})
def along(r: Ray, s: float) -> tuple[float, float]:
    """Latitude and longitude in degrees at the horizontal distance s in metres."""
    return (
        r.lat0 + s * (r.lat1 + s * (r.lat2 + s * (r.lat3 + s * (r.lat4 + s * r.lat5)))),
        r.lon0 + s * (r.lon1 + s * (r.lon2 + s * (r.lon3 + s * (r.lon4 + s * r.lon5)))),
    )


@njit(cache=True)
def bend(r: Ray, far_m: float) -> float:
    """Degrees a metre (or posts, if the ray is in posts) by which neither rate of a ray changes more, up to a distance.

    The triangle inequality on the derivatives of its polynomials, so that no place up to there lies further than
    `far_m` times as much from the tangent of the ray at its start.
    """
    return far_m * max(
        2 * abs(r.lat2) + far_m * (3 * abs(r.lat3) + far_m * (4 * abs(r.lat4) + far_m * 5 * abs(r.lat5))),
        2 * abs(r.lon2) + far_m * (3 * abs(r.lon3) + far_m * (4 * abs(r.lon4) + far_m * 5 * abs(r.lon5))),
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
