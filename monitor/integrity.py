"""One scan, the aircraft's state and the terrain to a verdict: does the stored terrain agree with the radar?"""

import math
from copy import copy
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from decoders.arinc708 import misread_bits
from decoders.formats import MODES_708
from monitor.aircraft import Aircraft
from monitor.calibration import NO_CALIBRATION, Calibration, uncalibrated
from monitor.comparison import Comparison, compare, thin
from monitor.coverage import uncovered
from monitor.decision import DEM_SHARE, RADAR_SHARE, Findings, Test, examine, pairs_for_verdict, untested
from monitor.disparity import statistic, threshold
from monitor.geodesy import LONGEST_RANGE_NM, NM_M
from monitor.hysteresis import Hysteresis
from monitor.offset import FINE_M, Search
from monitor.pointing import point
from monitor.prediction import Pointing
from monitor.quantities import RADIO_HEIGHT
from monitor.radio_altitude import first_bins, too_high
from monitor.sample import NOTHING, ScanSample
from monitor.scans import Scan
from monitor.screening import Screens
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from monitor.terrain_files import TerrainError
from monitor.tracking import ShadowTracker, fronts_of
from monitor.verdict import ALERT, OK, UNAVAILABLE, Verdict
from monitor.water import Water, WaterError, WaterFiles
from monitor.window import Window

MOST_UNMATCHED = 0.5  # share of shadows; without a calibration more of them forbid an ok
FLOWN_M = 2000.0  # farther than an aircraft flies between a radial in use and one that is not


class Monitor:
    """Holds the terrain with its large water, the calibration and the settings, and judges scans."""

    def __init__(
        self,
        terrain: Terrain,
        settings: MonitorSettings | None = None,
        calibration: Calibration | None = None,
        water: WaterFiles | None = None,
    ) -> None:
        self.terrain = terrain
        self.settings = settings or MonitorSettings()
        self.calibration = calibration
        self.water = water
        self._hysteresis = Hysteresis(self.settings.alert_scans, self.settings.clear_scans)
        self.forget()

    def anew(self) -> Self:
        """The same monitor without a memory, for another recording: what it learns there stays there."""
        other = copy(self)
        other._hysteresis = Hysteresis(self.settings.alert_scans, self.settings.clear_scans)
        other.forget()
        return other

    def forget(self) -> None:
        """Forget the scans before, as after a clock that began anew; an alert goes on standing."""
        self._window = Window(self.settings.window_scans)
        self._tracker = ShadowTracker(self.settings.tracked_scans)

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
        try:
            here = self.terrain.around(pointing.latitude_deg, pointing.longitude_deg, self._reach_m(scan))
            water = self.water.on(here) if self.water else None
        except (TerrainError, WaterError) as error:
            return self.unavailable(scan.number, [str(error), *reasons]), None
        screens, told = self._screens(scan, pointing, height_m, water)
        comparison, left_out = compare(scan, chosen, pointing, here, self.settings, screens)
        reasons += [*told, *left_out]
        over_ground_m = comparison.height_over_ground_m
        doubts = [*uncovered(over_ground_m, self.terrain.extent, pointing), *_buried(over_ground_m)]
        doubts += self._beyond_calibration(comparison.height_m)
        if self.settings.tracked_scans > 1:
            every, known, _ = point(scan, aircraft, steady, self.settings)
            fronts = fronts_of(scan, steady[known], every.over(here.extent), here.grid, self.settings)
            self._tracker.add(int(scan.time_ns[-1]), fronts)
        verdict, of_itself = self._decide(scan, comparison, doubts, reasons)
        if of_itself and self.settings.offset_search_m:
            calibration = self._calibration(scan)
            search = Search(scan, chosen, pointing, here, self.settings, calibration, screens)
            if found := search.most_likely():
                verdict = replace(
                    verdict,
                    offset_north_m=found.north_m,
                    offset_east_m=found.east_m,
                    offset_confidence=found.confidence,
                )
        return verdict, comparison

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
        c = self.calibration
        return c.mismatch(scan.bins.shape[1], scan.range_nm, scan.profile, self.settings) if c else None

    def _reach_m(self, scan: Scan) -> float:
        """How far from the radials in use the terrain of a scan may be looked at, moved about and on all radials."""
        return scan.range_nm * NM_M + math.sqrt(2) * (self.settings.offset_search_m + sum(FINE_M)) + FLOWN_M

    def _calibration(self, scan: Scan) -> Calibration:
        return self.calibration or uncalibrated(scan.bins.shape[1], scan.range_nm, scan.profile)

    def _screens(
        self, scan: Scan, pointing: Pointing, height_over_ground_m: NDArray[np.float64], water: Water | None
    ) -> tuple[Screens, list[str]]:
        """What decides which bins and shadows of a scan count, and what is to be said of it."""
        s, before = self.settings, self._tracker.before(int(scan.time_ns[0]))
        if not s.first_bin_from_radio_altitude:
            return Screens(None, water, before), []
        bin_width_m = scan.range_nm * NM_M / scan.bins.shape[1]
        near, told = first_bins(height_over_ground_m, pointing.elevation_rad, s.beam_width_deg, bin_width_m)
        return Screens(near, water, before), told

    def unavailable(self, scan: int, reasons: list[str]) -> Verdict:
        """The verdict that nothing can be said about a scan that could not be compared."""
        return self._told(scan, UNAVAILABLE, reasons, NOTHING, NOTHING.disparities, Findings(), 0)

    def _decide(
        self, scan: Scan, comparison: Comparison, doubts: list[str], reasons: list[str]
    ) -> tuple[Verdict, bool]:
        """The verdict, and whether it is an alert that this scan gives by itself."""
        bins = scan.bins.shape[1]
        now_ns, setting = int(scan.time_ns[-1]), (scan.range_nm, bins)
        calibration = self._calibration(scan)
        sample = comparison.sample(scan)
        pairs, scans = sample.disparities, 1
        unlike = self._unlike_calibration(sample)
        if unlike or doubts:  # which no scan to come may inherit
            self._window = Window(self.settings.window_scans)
        else:
            needed = pairs_for_verdict(self.settings, calibration)
            pairs, scans = self._window.gather(now_ns, setting, pairs, needed)
        findings = examine(sample, self.settings, calibration, pairs)
        if findings.alerts:
            verdict, first = UNAVAILABLE if unlike else ALERT, [str(test) for test in findings.alerts]
        elif findings.statistic is None:
            verdict, first = UNAVAILABLE, [findings.blind]
        else:
            first = self._contradictions(sample, pairs, findings)
            verdict = UNAVAILABLE if first or doubts or unlike else OK
        gathered = [f"pairs of the last {scans} scans together"] if scans > 1 else []
        because = [*unlike, *first, *doubts] if findings.alerts else [*doubts, *unlike, *first]  # the cause goes first
        because += [*gathered, *reasons]
        told = self._told(scan.number, verdict, because, sample, pairs, findings, scans)
        return told, verdict == told.verdict == ALERT and scans == 1

    def _told(
        self,
        scan: int,
        verdict: str,
        reasons: list[str],
        sample: ScanSample,
        d: NDArray[np.float64],
        findings: Findings,
        scans: int,
    ) -> Verdict:
        """A verdict with every number that there is, once it has settled."""
        settled, why = self._hysteresis.settle(verdict)
        shift, radar, dem = findings.shift, findings.unmatched_radar, findings.unmatched_dem
        n, test = len(d), findings.statistic
        return Verdict(
            scan=scan,
            verdict=settled,
            reasons=(*why, *reasons, *self._caveats()),
            n_pairs=n,
            scans=scans,
            t_bins2=statistic(d) if n else None,
            t_normalised=findings.t_normalised,
            q=findings.q,
            threshold=test.limit if test else None,
            mean_bins=float(np.mean(d)) if n else None,
            mean_stderr_bins=float(np.std(d, ddof=1) / math.sqrt(n)) if test else None,
            shift=shift.value if shift else None,
            shift_limit=shift.limit if shift else None,
            unmatched_radar=sample.unmatched_radar.share,
            unmatched_radar_limit=radar.limit if radar else None,
            unmatched_dem=sample.unmatched_dem.share,
            unmatched_dem_limit=dem.limit if dem else None,
            level=None if math.isnan(sample.level) else sample.level,
            mdb_bins=findings.mdb_bins,
            calibration=self.calibration.name if self.calibration else NO_CALIBRATION,
        )

    def _unlike_calibration(self, sample: ScanSample) -> list[str]:
        """What makes the calibration, and with it every probability, worthless for a scan."""
        c = self.calibration
        if c is None or c.level is None or c.level.hold(sample.level):
            return []
        found = "nothing is lit" if math.isnan(sample.level) else f"the mean level is {sample.level:.2f}"
        levels = f"{c.level.lowest:.2f} to {c.level.highest:.2f}"
        return [f"{found} in the farther half, where calibration {c.name} has {levels}: check the radar's gain"]

    def _beyond_calibration(self, height_m: float) -> list[str]:
        """What forbids an ok at heights where nobody knows what is normal; an alert may be of the terrain's height."""
        c = self.calibration
        if c is None or c.height_m is None or math.isnan(height_m) or c.height_m.hold(height_m):
            return []
        heights = f"{c.height_m.lowest:.0f} to {c.height_m.highest:.0f} m"
        mend = "calibrate at the heights that are flown"
        return [f"{height_m:.0f} m above ground, where calibration {c.name} has {heights}: {mend}"]

    def _contradictions(self, sample: ScanSample, pairs: NDArray[np.float64], findings: Findings) -> list[str]:
        """What forbids an ok that rests on stated defaults: they may be too wide for this radar, and hide an error."""
        if self.calibration:
            return []
        measures = (
            Test("N T / sigma^2", findings.t_normalised or 0.0, threshold(len(pairs), self.settings.p_fa)),
            Test(RADAR_SHARE, sample.unmatched_radar.share or 0.0, MOST_UNMATCHED),
            Test(DEM_SHARE, sample.unmatched_dem.share or 0.0, MOST_UNMATCHED),
        )
        return [f"without a calibration no ok: {test}" for test in measures if test.exceeded]

    def _caveats(self) -> list[str]:
        return ["no calibration loaded: stated defaults in use"] if self.calibration is None else []

    @property
    def told_first(self) -> list[str]:
        """What the first verdict says: what the settings ask for and cannot have, of the calibration or the water."""
        water = self.water.idle(self.terrain) if self.water else []
        return water + (untested(self.settings, self.calibration) if self.calibration else [])


def _buried(height_over_ground_m: NDArray[np.float64]) -> list[str]:
    """What forbids an ok where the aircraft is under the ground, as terrain in feet or a wrong datum puts it."""
    below_m = float(np.fmax.reduce(-height_over_ground_m, initial=0.0))
    return [f"the aircraft is {below_m:.0f} m below the stored terrain: check unit and datum"] if below_m else []


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
