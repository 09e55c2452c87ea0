"""One scan, the aircraft's state and the terrain to a verdict: does the stored terrain agree with the radar?"""

import math
from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from decoders.arinc708 import misread_bits
from decoders.formats import MODES_708
from monitor.aircraft import Aircraft
from monitor.calibration import NO_CALIBRATION, Calibration, uncalibrated
from monitor.comparison import Comparison, compare, thin
from monitor.disparity import (
    minimum_detectable_bias,
    normalised,
    robust_statistic,
    robust_threshold,
    statistic,
    threshold,
)
from monitor.geodesy import LONGEST_RANGE_NM, NM_M
from monitor.pointing import point
from monitor.prediction import Pointing
from monitor.quantities import RADIO_HEIGHT
from monitor.radio_altitude import first_bins, too_high
from monitor.scans import Scan
from monitor.screening import Screens
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from monitor.tracking import ShadowTracker, fronts_of
from monitor.verdict import ALERT, OK, UNAVAILABLE, Verdict
from monitor.water import Water

MOST_UNMATCHED = 0.6  # share of shadows; without a calibration more of them forbid an ok


class Monitor:
    """Holds the terrain with its large water, the calibration and the settings, and judges scans."""

    def __init__(
        self,
        terrain: Terrain,
        settings: MonitorSettings | None = None,
        calibration: Calibration | None = None,
        water: Water | None = None,
    ) -> None:
        self.terrain = terrain
        self.settings = settings or MonitorSettings()
        self.calibration = calibration
        self.water = water
        self._tracker = ShadowTracker(self.settings.tracked_scans)

    def anew(self) -> Self:
        """The same monitor without a memory of scans: for another recording, or after a clock that began anew."""
        other = copy(self)
        other._tracker = ShadowTracker(self.settings.tracked_scans)
        return other

    def judge(self, scan: Scan, aircraft: Aircraft) -> tuple[Verdict, Comparison | None]:
        """The verdict on a scan; the comparison is None where the radar or the state did not allow one."""
        refusal = self._refusal(scan)
        if refusal:
            return self.unavailable(scan.number, [refusal]), None
        steady = np.flatnonzero(~scan.beyond_limits)
        chosen = steady[thin(scan.scan_angle_deg[steady], self.settings.radial_spacing_deg)]
        pointing, usable, reasons = point(scan, aircraft, chosen, self.settings)
        reasons += _gaps(scan)
        if not usable.any():
            return self.unavailable(scan.number, reasons), None
        chosen = chosen[usable]
        limit_m = self.settings.radio_altitude_limit_m
        height_m = aircraft.tracks[RADIO_HEIGHT.name].at(scan.time_ns[chosen]).value
        if limit_m is not None and (high := too_high(height_m, limit_m)):
            return self.unavailable(scan.number, [high, *reasons]), None
        screens, told = self._screens(scan, pointing, height_m)
        comparison, left_out = compare(scan, chosen, pointing, self.terrain, self.settings, screens)
        reasons += [*told, *left_out]
        if self.settings.tracked_scans > 1:
            every, known, _ = point(scan, aircraft, steady, self.settings)
            fronts = fronts_of(scan, steady[known], every, self.terrain.grid, self.settings)
            self._tracker.add(int(scan.time_ns[-1]), fronts)
        return self._decide(scan, comparison, self._buried(pointing), reasons), comparison

    def _refusal(self, scan: Scan) -> str | None:
        if scan.mode != MODES_708["map"]:
            return f"radar is in mode {scan.mode}, not map: ground returns are filtered out"
        if scan.range_nm > LONGEST_RANGE_NM:
            return f"range setting {scan.range_nm:g} NM is beyond {LONGEST_RANGE_NM:g} NM, where shadows mean nothing"
        if 2 * scan.repeated > len(scan.time_ns):
            return f"scanner stuck: the scan angle did not change on {scan.repeated} of {len(scan.time_ns)} radials"
        if scan.faults:
            return f"radar reports faults: bits {scan.faults:07b} of the header's 18 to 24, the first at the right"
        if bits := misread_bits(scan.bins):
            return f"the range bins look like {bits} bits each: check radar_profile, or the channel's profile"
        return self.calibration.mismatch(scan.bins.shape[1], scan.range_nm) if self.calibration else None

    def _screens(
        self, scan: Scan, pointing: Pointing, height_over_ground_m: NDArray[np.float64]
    ) -> tuple[Screens, list[str]]:
        """What decides which bins and shadows of a scan count, and what is to be said of it."""
        s, before = self.settings, self._tracker.before(int(scan.time_ns[0]))
        if not s.first_bin_from_radio_altitude:
            return Screens(None, self.water, before), []
        bin_width_m = scan.range_nm * NM_M / scan.bins.shape[1]
        near, told = first_bins(height_over_ground_m, pointing.elevation_rad, s.beam_width_deg, bin_width_m)
        return Screens(near, self.water, before), told

    def _decide(self, scan: Scan, comparison: Comparison, doubts: list[str], reasons: list[str]) -> Verdict:
        s, d = self.settings, comparison.disparities
        c = self.calibration or uncalibrated(scan.bins.shape[1])
        n = len(d)
        reasons = [*doubts, *reasons]
        if n < s.pairs_needed:
            few = f"{n} pairs of shadows, {s.pairs_needed} needed"
            return self.unavailable(scan.number, [few, *reasons], comparison)
        q = robust_statistic(d, c.median_bins, c.clip_bins, c.sigma_bins)
        t_normalised = normalised(d, c.rms_bins)
        if s.method == "robust":
            value, limit = q, robust_threshold(n, s.p_fa, c.variance_factor)
        else:
            value, limit = t_normalised, threshold(n, s.p_fa)
        most = n * (c.clip_bins / c.sigma_bins) ** 2  # what Q comes to if every pair is clipped
        if s.method == "robust" and most <= limit:
            blind = (
                f"{n} pairs cannot alert at P_FA {s.p_fa:g}: Q reaches {most:.1f} at most, its threshold is {limit:.1f}"
            )
            return self.unavailable(scan.number, [blind, *reasons], comparison)
        if value > limit:
            verdict = ALERT
            reasons.insert(0, f"{'Q' if s.method == 'robust' else 'N T / sigma^2'} {value:.1f} exceeds {limit:.1f}")
        else:
            contradictions = self._contradictions(comparison, t_normalised)
            verdict = UNAVAILABLE if doubts or contradictions else OK
            reasons = [*contradictions, *reasons]
        return Verdict(
            scan=scan.number,
            verdict=verdict,
            reasons=tuple(reasons + self._caveats()),
            n_pairs=n,
            t_bins2=statistic(d),
            t_normalised=t_normalised,
            q=q,
            threshold=limit,
            mean_bins=float(np.mean(d)),
            mean_stderr_bins=float(np.std(d, ddof=1) / math.sqrt(n)),
            unmatched_radar=comparison.unmatched_radar,
            unmatched_dem=comparison.unmatched_dem,
            mdb_bins=minimum_detectable_bias(n, c.rms_bins, s.p_fa, s.p_md),
            calibration=c.name,
        )

    def unavailable(self, scan: int, reasons: list[str], comparison: Comparison | None = None) -> Verdict:
        """The verdict that nothing can be said about a scan, with whatever was measured all the same."""
        d = comparison.disparities if comparison else np.empty(0)
        return Verdict(
            scan=scan,
            verdict=UNAVAILABLE,
            reasons=tuple(reasons + self._caveats()),
            n_pairs=len(d),
            t_bins2=statistic(d) if len(d) else None,
            t_normalised=None,
            q=None,
            threshold=None,
            mean_bins=float(np.mean(d)) if len(d) else None,
            mean_stderr_bins=None,
            unmatched_radar=comparison.unmatched_radar if comparison else None,
            unmatched_dem=comparison.unmatched_dem if comparison else None,
            mdb_bins=None,
            calibration=self.calibration.name if self.calibration else NO_CALIBRATION,
        )

    def _buried(self, pointing: Pointing) -> list[str]:
        """What forbids an ok where the aircraft is under the ground, as terrain in feet or a wrong datum puts it."""
        ground_m = self.terrain.elevation(pointing.latitude_deg, pointing.longitude_deg)
        below_m = float(np.fmax.reduce(ground_m - pointing.height_m, initial=0.0))
        return [f"the aircraft is {below_m:.0f} m below the stored terrain: check unit and datum"] if below_m else []

    def _contradictions(self, comparison: Comparison, t_normalised: float) -> list[str]:
        """What forbids an ok that rests on stated defaults: they may be too wide for this radar, and hide an error."""
        if self.calibration:
            return []
        n = len(comparison.disparities)
        measures = (
            ("N T / sigma^2", t_normalised, threshold(n, self.settings.p_fa)),
            ("the unmatched share of radar shadows", comparison.unmatched_radar, MOST_UNMATCHED),
            ("the unmatched share of terrain shadows", comparison.unmatched_dem, MOST_UNMATCHED),
        )
        return [
            f"without a calibration no ok: {name} {value:.3g} exceeds {limit:.3g}"
            for name, value, limit in measures
            if value is not None and value > limit
        ]

    def _caveats(self) -> list[str]:
        return ["no calibration loaded: stated defaults in use"] if self.calibration is None else []


def _gaps(scan: Scan) -> list[str]:
    """What is missing in a sweep, or not to be used."""
    reasons = []
    if scan.missing:
        reasons.append(f"{scan.missing} radials are missing inside the sweep")
    if scan.cut_off:
        reasons.append(f"{scan.cut_off} radials at the ends of the sweep before are missing in this one")
    if scan.repeated:
        reasons.append(f"the scan angle did not change on {scan.repeated} of {len(scan.time_ns)} radials")
    if scan.beyond_limits.any():
        reasons.append(f"{np.count_nonzero(scan.beyond_limits)} radials have attitude or tilt beyond limits")
    return reasons
