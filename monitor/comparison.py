"""Both threads of one scan side by side: what the radar saw, what the stored terrain predicts, and the pairs."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from monitor.geodesy import NM_M
from monitor.prediction import Beam, Pointing, predict
from monitor.sample import ScanSample, Unmatched, signal_level
from monitor.scans import Scan
from monitor.screening import NO_SCREENS, Scene, Screens, screen
from monitor.settings import MonitorSettings
from monitor.shade import DEM_INITIAL, pair, pair_first, radar_states, shadows, unmatched_share
from monitor.terrain import Terrain

PAIRINGS: Final[dict[str, Callable[[Any, Any], NDArray[np.void]]]] = {"overlap": pair, "first": pair_first}


@dataclass(frozen=True)
class Comparison:
    """Both threads of one scan on the radials in use (n,), and their pairs of shadows (N,): for pictures and exports.

    `seen` and `predicted` are the two shadows of each pair, as `monitor.shade.shadows` gives them, their radials as
    indices among those in use; `pair_azimuth_rad` are these radials' true azimuths.
    `height_over_ground_m` is the antenna's on all radials of the pointing, NaN where the ground below is not known.
    """

    scan_angle_deg: NDArray[np.float64]
    radar_states: NDArray[np.int8]
    dem_states: NDArray[np.int8]
    seen: NDArray[np.void]
    predicted: NDArray[np.void]
    pair_azimuth_rad: NDArray[np.float64]
    unmatched_radar: Unmatched
    unmatched_dem: Unmatched
    height_over_ground_m: NDArray[np.float64]

    @property
    def height_m(self) -> float:
        """The mean height over the ground, NaN where that is known on no radial."""
        known = self.height_over_ground_m[np.isfinite(self.height_over_ground_m)]
        return float(known.mean()) if known.size else math.nan

    @property
    def disparities(self) -> NDArray[np.float64]:
        """D of eq. (6), range bins."""
        return np.asarray(self.seen["centre"] - self.predicted["centre"])

    def sample(self, scan: Scan) -> ScanSample:
        """What the tests look at, of the scan that was compared."""
        front, back = (np.subtract(self.seen[edge], self.predicted[edge], dtype=float) for edge in ("front", "back"))
        size = self.predicted["size"].astype(float)
        shares = self.unmatched_radar, self.unmatched_dem
        return ScanSample(front, back, self.pair_azimuth_rad, size, *shares, signal_level(scan.bins), self.height_m)


def compare(
    scan: Scan,
    radials: NDArray[np.intp],
    pointing: Pointing,
    terrain: Terrain,
    settings: MonitorSettings,
    screens: Screens = NO_SCREENS,
) -> tuple[Comparison, list[str]]:
    """Compare on some radials of a scan, (n,) like the pointing; and what of it was left out, and why."""
    s, bins, pointing = settings, scan.bins.shape[1], pointing.over(terrain.extent)
    bin_width_m = scan.range_nm * NM_M / bins
    limit = bins if s.range_limit_nm is None else max(1, min(bins, int(bins * s.range_limit_nm / scan.range_nm)))
    beam = Beam.of(s)
    dem, void = predict(terrain.grid, pointing, limit, bin_width_m, beam)
    dem, radials = dem[~void], radials[~void]
    angles, echoes = scan.scan_angle_deg[radials], scan.bins[radials, :limit]
    if screens.bins_left_out is not None:
        near = np.arange(limit) < screens.bins_left_out[~void, None]
        echoes[near], dem[near] = 0, DEM_INITIAL  # the radials begin there, but nearer ground still casts its shadow
    radar = radar_states(echoes)
    every_seen, every_predicted = shadows(radar, "radar", s.minimum_size), shadows(dem, "dem", s.minimum_size)
    seen, predicted = (some[some["size"] <= (s.maximum_size or limit)] for some in (every_seen, every_predicted))
    scene = Scene(terrain.grid, angles, Pointing(*(column[~void] for column in pointing)), bin_width_m)
    counts = screen(seen, predicted, scene, s, screens)
    counted, expected = seen[counts.radar], predicted[counts.dem]
    # Range-limited shadows stay out before pairing: one of them must not take the place of a whole one.
    whole, foreseen = counted[~counted["range_limited"]], expected[~expected["range_limited"]]
    pairs = PAIRINGS[s.pairing](whole, foreseen)
    lost = [f"{np.count_nonzero(void)} radials leave the terrain or cross voids"] if void.any() else []
    return Comparison(
        angles,
        radar,
        dem,
        whole[pairs["radar"]],
        foreseen[pairs["dem"]],
        scene.pointing.azimuth_rad[pairs["radial"]],
        Unmatched(*unmatched_share(counted[counted["size"] >= s.unmatched_size], every_predicted, dem)),
        Unmatched(*unmatched_share(expected[expected["size"] >= s.unmatched_size], every_seen, radar)),
        pointing.height_m - terrain.elevation(pointing.latitude_deg, pointing.longitude_deg),
    ), [*lost, *counts.reasons]


def thin(scan_angle_deg: NDArray[np.float64], spacing_deg: float) -> NDArray[np.intp]:
    """Indices of one radial for each multiple of `spacing_deg`, the nearest to it, in order of arrival.

    Neighbours within a beam see the same shadow: counted as independent they turn a P_FA of 1e-3 into 0.04.
    """
    around = np.floor(360 / spacing_deg)  # cells of a full circle, whose first and last are one
    cell = np.round(scan_angle_deg / spacing_deg)
    off_deg, cell = np.abs(scan_angle_deg - cell * spacing_deg), cell % around
    order = np.lexsort((off_deg, cell))
    nearest = np.ones(len(order), np.bool_)
    np.not_equal(cell[order[1:]], cell[order[:-1]], out=nearest[1:])
    return np.sort(order[nearest])
