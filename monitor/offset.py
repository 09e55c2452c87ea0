"""The horizontal error that explains a scan best: the terrain is moved about until its shadows meet the radar's.

A disparity has the likelihood that Q gives it, exp(-clip(D - m)^2 / (2 c sigma^2)), and a shadow without a partner that
of one at the clip. So what must not happen, that fewer pairs look better, does not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.calibration import Calibration
from monitor.comparison import compare
from monitor.disparity import clipped
from monitor.geodesy import displace
from monitor.prediction import Pointing
from monitor.scans import Scan
from monitor.screening import NO_SCREENS, Screens
from monitor.settings import SEARCH_STEP_M, MonitorSettings
from monitor.terrain import Terrain

FINE_M = (100.0, 50.0)  # to each side of the best so far
COARSE_FAN = 3  # sub-azimuths are enough to find the neighbourhood


@dataclass(frozen=True)
class Offset:
    """Where the stored terrain, or the position the wrong way round, seems to be off, and how sure that is.

    `confidence` is the share of the likelihood of all places searched that lies within a step (200 m) of the best.
    """

    north_m: float
    east_m: float
    confidence: float


@dataclass(frozen=True)
class Search:
    """A scan to explain: its radials in use (n,) with their pointing, and what judges them."""

    scan: Scan
    radials: NDArray[np.intp]
    pointing: Pointing
    terrain: Terrain
    settings: MonitorSettings
    calibration: Calibration
    screens: Screens = NO_SCREENS

    def most_likely(self) -> Offset | None:
        """The most likely error within `offset_search_m` to each side, the least of equals; None if nothing pairs."""
        steps = int(self.settings.offset_search_m // SEARCH_STEP_M)
        places_m = SEARCH_STEP_M * np.arange(-steps, steps + 1)
        fan = min(self.settings.azimuth_fan, COARSE_FAN)
        log = np.array([[self._log_likelihood(n, e, fan) for e in places_m] for n in places_m])
        if not log.any():
            return None
        distance_m = np.hypot(*np.meshgrid(places_m, places_m))
        row, column = np.unravel_index(np.lexsort((distance_m.ravel(), -log.ravel()))[0], log.shape)
        weight = np.exp(log - log.max())
        near = weight[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        north_m, east_m = float(places_m[row]), float(places_m[column])
        for step_m in FINE_M:
            around = [(north_m + n * step_m, east_m + e * step_m) for n in (0, -1, 1) for e in (0, -1, 1)]
            inside = [at for at in around if max(map(abs, at)) <= self.settings.offset_search_m]
            north_m, east_m = max(inside, key=lambda at: self._log_likelihood(at[0], at[1], self.settings.azimuth_fan))
        return Offset(north_m, east_m, float(near.sum() / weight.sum()))

    def _log_likelihood(self, north_m: float, east_m: float, fan: int) -> float:
        """Up to a constant, of terrain that is stored so far from where it is."""
        one = np.ones(len(self.radials))
        p = self.pointing
        lat, lon, _ = displace(p.latitude_deg, p.longitude_deg, p.height_m, east_m * one, north_m * one, 0 * one)
        moved = p._replace(latitude_deg=lat, longitude_deg=lon)
        # Shadows are not tracked: seen from a place that is moved, no front stands where it stood.
        settings = self.settings.model_copy(update={"azimuth_fan": fan, "tracked_scans": 1})
        comparison, _ = compare(self.scan, self.radials, moved, self.terrain, settings, self.screens)
        c = self.calibration
        gained = c.clip_bins**2 - clipped(comparison.disparities, c.median_bins, c.clip_bins) ** 2
        return float(gained.sum() / (2 * c.variance_factor * c.sigma_bins**2))
