"""What may be wrong with the terrain, the position or the radar, applied to what the monitor is given of a flight.

The echoes stay those of the true ground; each fault changes the monitor's terrain or its scan, and nothing else.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter, zoom

from monitor.scans import Scan
from monitor.terrain import Grid

METRES_PER_DEGREE = 111_132.0
SCAN_S = 61 * 3 / 40
RIDGE_PERCENTILE = 90.0
STALE_POSTS = 10  # averaged, as in terrain of the generation before


@dataclass(frozen=True)
class Fault:
    """One fault of one size; `terrain` gets the true grid, the flight's number and the scan's, `scan` the true scan.

    `rebuilt` is terrain with other heights, which is the same for all flights.
    """

    kind: str
    size: float
    unit: str
    terrain: Callable[[Grid, int, int], Grid] | None = None
    scan: Callable[[Scan], Scan] | None = None
    rebuilt: Callable[[Grid], Grid] | None = None

    @property
    def name(self) -> str:
        """Kind and size."""
        return f"{self.kind} {self.size:g} {self.unit}".strip()


def moved(grid: Grid, distance_m: float, direction: int) -> Grid:
    """Terrain that is stored so far off towards one of the eight directions."""
    angle = np.radians(45.0 * direction)
    north_deg = distance_m * np.cos(angle) / METRES_PER_DEGREE
    east_deg = distance_m * np.sin(angle) / (METRES_PER_DEGREE * np.cos(np.radians(grid.north_deg)))
    return grid._replace(north_deg=grid.north_deg + north_deg, west_deg=grid.west_deg + east_deg)


def _heights(grid: Grid, height_m: NDArray[np.floating]) -> Grid:
    return grid.with_heights(np.ascontiguousarray(height_m, np.float32))


def _shift(size: float) -> Fault:
    return Fault("terrain shifted", size, "m", lambda grid, flight, _: moved(grid, size, flight))


def _up(size: float) -> Fault:
    return Fault("terrain too high by", size, "m", rebuilt=lambda grid: _heights(grid, grid.height_m + size))


def _drift(size: float) -> Fault:
    return Fault(
        "position drifts at", size, "m/s", lambda grid, flight, scan: moved(grid, size * SCAN_S * (scan + 1), flight)
    )


def _tilt(size: float) -> Fault:
    return Fault("tilt wrong by", size, "deg", scan=lambda scan: replace(scan, tilt_deg=scan.tilt_deg + size))


def _heading(size: float) -> Fault:
    return Fault("heading wrong by", size, "deg", scan=lambda scan: replace(scan, scan_angle_deg=_turned(scan, size)))


def _turned(scan: Scan, by_deg: float) -> NDArray[np.float64]:
    return (scan.scan_angle_deg + by_deg + 180) % 360 - 180


def _latency(size: float) -> Fault:
    return Fault(
        "navigation late by", size, "s", scan=lambda scan: replace(scan, time_ns=scan.time_ns - round(size * 1e9))
    )


def _cut_ridges(grid: Grid) -> Grid:
    return _heights(grid, np.minimum(grid.height_m, np.nanpercentile(grid.height_m, RIDGE_PERCENTILE)))


def _stale(grid: Grid) -> Grid:
    filled = np.where(np.isnan(grid.height_m), np.nanmedian(grid.height_m), grid.height_m)
    coarse = uniform_filter(filled, STALE_POSTS)[STALE_POSTS // 2 :: STALE_POSTS, STALE_POSTS // 2 :: STALE_POSTS]
    scale = [have / got for have, got in zip(filled.shape, coarse.shape, strict=True)]
    fine = zoom(coarse, scale, order=1, grid_mode=True, mode="nearest")
    return _heights(grid, np.where(np.isnan(grid.height_m), np.nan, fine))


NONE = Fault("none", 0.0, "")
FAULTS = (
    NONE,
    *(_shift(size) for size in (50.0, 100.0, 200.0, 500.0, 1000.0)),
    *(_up(size) for size in (10.0, 20.0, 50.0, 100.0, -50.0)),
    Fault("highest tenth of the terrain missing", 0.0, "", rebuilt=_cut_ridges),
    Fault("terrain ten times as coarse", 0.0, "", rebuilt=_stale),
    Fault("the tile of another place", 0.0, "", rebuilt=lambda grid: _heights(grid, grid.height_m[:, ::-1])),
    *(_tilt(size) for size in (0.25, 0.5, 1.0, 2.0)),
    *(_heading(size) for size in (0.5, 1.0, 2.0)),
    *(_latency(size) for size in (0.1, 0.2, 0.5, 1.0)),
    *(_drift(size) for size in (5.0, 20.0)),
)
