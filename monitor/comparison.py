"""Both threads of one scan side by side: what the radar saw, what the stored terrain predicts, and the pairs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.geodesy import NM_M
from monitor.prediction import Beam, Pointing, predict
from monitor.sample import ScanSample, Unmatched, signal_level
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import pair, radar_states, shadows, unmatched_share
from monitor.terrain import Terrain


@dataclass(frozen=True)
class Comparison:
    """Both threads of one scan on the radials in use (n,), and their pairs of shadows (N,): for pictures and exports.

    Centres of shadows are in range bins; `pair_radial` is the index of a pair's radial among those in use.
    """

    scan_angle_deg: NDArray[np.float64]
    radar_states: NDArray[np.int8]
    dem_states: NDArray[np.int8]
    pair_radial: NDArray[np.int64]
    radar_centre: NDArray[np.float64]
    dem_centre: NDArray[np.float64]
    unmatched_radar: Unmatched
    unmatched_dem: Unmatched

    @property
    def disparities(self) -> NDArray[np.float64]:
        """D of eq. (6), range bins."""
        return self.radar_centre - self.dem_centre

    def sample(self, scan: Scan) -> ScanSample:
        """What the tests look at, of the scan that was compared."""
        return ScanSample(self.disparities, self.unmatched_radar, self.unmatched_dem, signal_level(scan.bins))


def compare(
    scan: Scan, radials: NDArray[np.intp], pointing: Pointing, terrain: Terrain, settings: MonitorSettings
) -> tuple[Comparison, int]:
    """Compare on some radials of a scan, (n,) like the pointing; and how many of them leave the terrain."""
    s, bins = settings, scan.bins.shape[1]
    limit = bins if s.range_limit_nm is None else max(1, min(bins, int(bins * s.range_limit_nm / scan.range_nm)))
    beam = Beam(s.beam_width_deg, s.azimuth_fan, s.azimuth_span, s.refraction_k, s.range_reference)
    dem, void = predict(terrain.grid, pointing, limit, scan.range_nm * NM_M / bins, beam)
    dem, radials = dem[~void], radials[~void]
    radar = radar_states(scan.bins[radials, :limit])
    seen = shadows(radar, "radar", s.minimum_size, s.maximum_size)
    predicted = shadows(dem, "dem", s.minimum_size, s.maximum_size)
    # Range-limited shadows stay out before pairing: one of them must not take the place of a whole one.
    whole, foreseen = seen[~seen["range_limited"]], predicted[~predicted["range_limited"]]
    pairs = pair(whole, foreseen)
    return Comparison(
        scan.scan_angle_deg[radials],
        radar,
        dem,
        pairs["radial"],
        whole["centre"][pairs["radar"]],
        foreseen["centre"][pairs["dem"]],
        Unmatched(*unmatched_share(seen, predicted, dem)),
        Unmatched(*unmatched_share(predicted, seen, radar)),
    ), int(np.count_nonzero(void))


def thin(scan_angle_deg: NDArray[np.float64], spacing_deg: float) -> NDArray[np.intp]:
    """Indices of one radial for each multiple of `spacing_deg`, the nearest to it, in order of arrival.

    Neighbours within a beam see the same shadow: counted as independent they turn a P_FA of 1e-3 into 0.04.
    """
    cell = np.round(scan_angle_deg / spacing_deg)
    order = np.lexsort((np.abs(scan_angle_deg - cell * spacing_deg), cell))
    return np.sort(order[np.diff(cell[order], prepend=-np.inf) > 0])
