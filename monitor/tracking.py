"""Shadows over several scans: one that stands still on the ground while the aircraft flies is the terrain's.

Young, Uijt de Haag and Campbell (2004), section 4 (e). What is followed is the front edge, which lies at a crest, and
not the back, which moves away as the aircraft comes nearer. What keeps its range and bearing instead, as an echo of the
aircraft or a fault of the radar does, moves over the ground as fast as the aircraft.
"""

from collections import deque
from math import cos, radians, sin
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor.geodesy import ECCENTRICITY_SQUARED, NM_M, curvature_radii
from monitor.places import line, place
from monitor.prediction import Pointing
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import radar_states, shadows
from monitor.terrain import Grid

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

FORGOTTEN_NS = 20_000_000_000  # a few sweeps: what was seen longer ago is no scan before


class Fronts(NamedTuple):
    """Where the front edges of a scan's radar shadows lay, and when its last radial was measured."""

    time_ns: int
    tree: "cKDTree"

    def hold(self, points_m: NDArray[np.float64], tolerance_m: float) -> NDArray[np.bool_]:
        """Which points (k, 3) have a front within the tolerance."""
        near = np.zeros(len(points_m), bool)
        known = np.isfinite(points_m).all(axis=1)
        if known.any() and self.tree.n:
            near[known] = self.tree.query(points_m[known])[0] <= tolerance_m
        return near


class ShadowTracker:
    """The fronts of the last scans that were compared; one scan less than shadows are tracked over."""

    def __init__(self, scans: int) -> None:
        self._before: deque[Fronts] = deque(maxlen=scans - 1)

    def before(self, time_ns: int) -> tuple[Fronts, ...]:
        """The scans before one that begins at a time; none of them if the clock began anew or long fell silent."""
        if self._before and not 0 <= time_ns - self._before[-1].time_ns <= FORGOTTEN_NS:
            self._before.clear()
        return tuple(self._before)

    def add(self, time_ns: int, points_m: NDArray[np.float64]) -> None:
        """Keep the fronts (k, 3) of a scan whose last radial was measured at a time."""
        from scipy.spatial import cKDTree  # noqa: PLC0415 # only where shadows are tracked, as it takes its time

        self._before.append(Fronts(time_ns, cKDTree(points_m[np.isfinite(points_m).all(axis=1)])))


def fronts_of(
    scan: Scan, radials: NDArray[np.intp], pointing: Pointing, grid: Grid, settings: MonitorSettings
) -> NDArray[np.float64]:
    """The fronts of all radar shadows on the radials (n,) of a scan, as `front_points`.

    All radials, and not those alone that are in use: with one in 3 degrees the next scan would seldom look at the same
    part of a crest.
    """
    found = shadows(radar_states(scan.bins[radials]), "radar", settings.minimum_size, settings.maximum_size)
    return front_points(found, pointing, grid, scan.range_nm * NM_M / scan.bins.shape[1])


def front_points(found: NDArray[np.void], pointing: Pointing, grid: Grid, bin_width_m: float) -> NDArray[np.float64]:
    """The front edges of shadows (k,) on radials (n,) as Earth-centred points (k, 3) at sea level, metres.

    Chords between such points are distances on the ground to a millimetre over kilometres, on either side of the
    antimeridian.
    """
    return np.asarray(_front_points(grid, pointing, bin_width_m, found))


@njit(cache=True)
def _front_points(grid, pointing, bin_width_m, found):  # type: ignore[no-untyped-def] # typed by front_points
    out = np.empty((found.size, 3))
    for k in range(found.size):
        i = found[k].radial
        if k == 0 or found[k - 1].radial != i:
            track, ground = line(grid, pointing, i)
        latitude, longitude, ground = place(
            grid, track, pointing.height_m[i], ground, (found[k].front - 0.5) * bin_width_m
        )
        phi, lam = radians(latitude), radians(longitude)
        _, prime = curvature_radii(phi)
        out[k, 0], out[k, 1] = prime * cos(phi) * cos(lam), prime * cos(phi) * sin(lam)
        out[k, 2] = prime * (1 - ECCENTRICITY_SQUARED) * sin(phi)
    return out
