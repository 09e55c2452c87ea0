"""Places on a radial and lever arms beside pyproj and pymap3d, at drawn places within the stated limits."""

from importlib.metadata import version

import numpy as np
import pymap3d
from pymap3d.vincenty import vreckon
from pyproj import Geod

from monitor.geodesy import HIGHEST_LATITUDE_DEG, LONGEST_RANGE_NM, NM_M, along, displace, ray

DRAWN, SEED = 20_000, 11
RANGES_NM = (5.0, 10.0, 20.0, 40.0, LONGEST_RANGE_NM)
MILLIMETRE = 1e-3  # the claim of monitor.geodesy
LARGEST_ARM_M = 100.0
LOWEST_M, HIGHEST_M = -500.0, 15_000.0


def section() -> list[str]:
    """The report's lines, as Markdown."""
    random = np.random.default_rng(SEED)
    pyproj, pymap3d_ = f"pyproj {version('pyproj')}", f"pymap3d {version('pymap3d')}"
    lines = [
        f"Beside {pyproj} and {pymap3d_}: {DRAWN} drawn places up to {HIGHEST_LATITUDE_DEG:g} degrees from the",
        "equator, azimuths, and distances up to each range setting, on the ellipsoid, as neither knows a surface above",
        "it. One has Karney's series, the other Vincenty's; the claim is a millimetre.",
        "",
        f"| range setting | largest distance from {pyproj} | from {pymap3d_} | the two from each other | claim |",
        "|---|---|---|---|---|",
    ]
    for range_nm in RANGES_NM:
        by_geod, by_vincenty, they = _rays(random, range_nm)
        lines.append(
            f"| {range_nm:g} NM | {1e3 * by_geod:.4f} mm | {1e3 * by_vincenty:.4f} mm | {1e3 * they:.4f} mm "
            f"| {'holds' if max(by_geod, by_vincenty) <= MILLIMETRE else 'FAILS'} |"
        )
    worst_m = _arms(random)
    word = "holds" if worst_m <= MILLIMETRE else "FAILS"
    return [
        *lines,
        "",
        f"Lever arms of up to {LARGEST_ARM_M:g} m each way, {LOWEST_M:g} to {HIGHEST_M:g} m high, anywhere on Earth:",
        f"at most {1e3 * worst_m:.4f} mm from {pymap3d_}; to a millimetre {word}.",
    ]


def _rays(random: np.random.Generator, range_nm: float) -> tuple[float, float, float]:
    """How far drawn points lie at most from where pyproj and pymap3d put them, and those from each other, metres."""
    latitude = random.uniform(-HIGHEST_LATITUDE_DEG, HIGHEST_LATITUDE_DEG, DRAWN)
    longitude, azimuth = random.uniform(-180, 180, DRAWN), random.uniform(0, 360, DRAWN)
    s = random.uniform(0, range_nm * NM_M, DRAWN)
    rays = (ray(*place) for place in zip(latitude, longitude, np.zeros(DRAWN), np.radians(azimuth), strict=True))
    ours = np.array([along(one, distance) for one, distance in zip(rays, s, strict=True)]).T
    by_geod = Geod(ellps="WGS84").fwd(longitude, latitude, azimuth, s)[1::-1]
    by_vincenty = vreckon(latitude, longitude, s, azimuth)
    spaces = [np.array(pymap3d.geodetic2ecef(*place, np.zeros(DRAWN))) for place in (ours, by_geod, by_vincenty)]
    pairs = ((0, 1), (0, 2), (1, 2))
    first, second, third = (float(np.linalg.norm(spaces[i] - spaces[j], axis=0).max()) for i, j in pairs)
    return first, second, third


def _arms(random: np.random.Generator) -> float:
    """The largest distance in space between where a lever arm leads here and in pymap3d, metres."""
    latitude, longitude = random.uniform(-90, 90, DRAWN), random.uniform(-180, 180, DRAWN)
    height_m, arm_m = (
        random.uniform(LOWEST_M, HIGHEST_M, DRAWN),
        random.uniform(-LARGEST_ARM_M, LARGEST_ARM_M, (3, DRAWN)),
    )
    ours = pymap3d.geodetic2ecef(*displace(latitude, longitude, height_m, *arm_m))
    theirs = pymap3d.enu2ecef(*arm_m, latitude, longitude, height_m)
    return float(np.linalg.norm(np.subtract(ours, theirs), axis=0).max())
