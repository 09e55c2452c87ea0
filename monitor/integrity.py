"""One scan, the aircraft's state and the terrain to a verdict: does the stored terrain agree with the radar?"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoders.arinc708 import misread_bits
from decoders.formats import MODES_708
from monitor import quantities as state
from monitor.aircraft import Aircraft, status_name
from monitor.calibration import NO_CALIBRATION, Calibration, uncalibrated
from monitor.disparity import (
    minimum_detectable_bias,
    normalised,
    robust_statistic,
    robust_threshold,
    statistic,
    threshold,
)
from monitor.gate import position_doubts
from monitor.geodesy import HIGHEST_LATITUDE_DEG, LONGEST_RANGE_NM, NM_M, body_to_enu, displace
from monitor.prediction import Beam, Pointing, predict
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import pair, radar_states, shadows, unmatched_share
from monitor.terrain import Terrain

OK, ALERT, UNAVAILABLE = "ok", "alert", "unavailable"
NEEDED = (state.LATITUDE, state.LONGITUDE, state.HEIGHT, state.PITCH, state.ROLL, state.HEADING)
MOST_UNMATCHED = 0.6  # share of shadows; without a calibration more of them forbid an ok


@dataclass(frozen=True)
class Verdict:
    """The answer for one scan, and the numbers behind it. Disparities are in range bins.

    `mdb_bins` is the minimum detectable bias of the published test, with the plain rms of the calibration.
    """

    scan: int
    verdict: str
    reasons: tuple[str, ...]
    n_pairs: int
    t_bins2: float | None
    t_normalised: float | None
    q: float | None
    threshold: float | None
    mean_bins: float | None
    mean_stderr_bins: float | None
    unmatched_radar: float | None
    unmatched_dem: float | None
    mdb_bins: float | None
    calibration: str


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
    unmatched_radar: float | None
    unmatched_dem: float | None

    @property
    def disparities(self) -> NDArray[np.float64]:
        """D of eq. (6), range bins."""
        return self.radar_centre - self.dem_centre


class Monitor:
    """Holds the terrain, the calibration and the settings, and judges scans."""

    def __init__(
        self, terrain: Terrain, settings: MonitorSettings | None = None, calibration: Calibration | None = None
    ) -> None:
        self.terrain = terrain
        self.settings = settings or MonitorSettings()
        self.calibration = calibration

    def judge(self, scan: Scan, aircraft: Aircraft) -> tuple[Verdict, Comparison | None]:
        """The verdict on a scan; the comparison is None where the radar or the state did not allow one."""
        refusal = self._refusal(scan)
        if refusal:
            return self.unavailable(scan.number, [refusal]), None
        steady = np.flatnonzero(~scan.beyond_limits)
        chosen = steady[thin(scan.scan_angle_deg[steady], self.settings.radial_spacing_deg)]
        pointing, usable, reasons = self._point(scan, aircraft, chosen)
        if not usable.any():
            return self.unavailable(scan.number, reasons), None
        comparison, lost = self._compare(scan, chosen[usable], pointing)
        if lost:
            reasons.append(f"{lost} radials leave the terrain or cross voids")
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

    def _point(
        self, scan: Scan, aircraft: Aircraft, chosen: NDArray[np.intp]
    ) -> tuple[Pointing, NDArray[np.bool_], list[str]]:
        """Where the antenna was and looked, on the radials whose state is known, and why others are not."""
        times = scan.time_ns[chosen]
        found = [aircraft.tracks[quantity.name].at(times) for quantity in NEEDED]
        status = np.array([values.status for values in found])
        usable = (status == 0).all(axis=0)
        reasons = [
            f"{quantity.name}: {status_name(int(row[row > 0][0]))} on {np.count_nonzero(row)} of {len(times)} radials"
            for quantity, row in zip(NEEDED, status, strict=True)
            if row.any()
        ]
        if self.settings.position_gate:
            doubtful, doubts = position_doubts(aircraft, times, self.settings.largest_integrity_limit_nm)
            usable &= ~doubtful
            reasons += doubts
        polar = usable & (np.abs(found[0].value) > HIGHEST_LATITUDE_DEG)
        if polar.any():
            usable &= ~polar
            reasons.append(
                f"{np.count_nonzero(polar)} radials start beyond {HIGHEST_LATITUDE_DEG:g} degrees of latitude"
            )
        if scan.missing:
            reasons.append(f"{scan.missing} radials are missing inside the sweep")
        if scan.cut_off:
            reasons.append(f"{scan.cut_off} radials at the ends of the sweep before are missing in this one")
        if scan.repeated:
            reasons.append(f"the scan angle did not change on {scan.repeated} of {len(scan.time_ns)} radials")
        if scan.beyond_limits.any():
            reasons.append(f"{np.count_nonzero(scan.beyond_limits)} radials have attitude or tilt beyond limits")
        lat, lon, height, pitch, roll, heading = (values.value[usable] for values in found)
        arm = self.settings.lever_arm
        ones = np.ones(len(lat))
        east, north, up = body_to_enu(arm.forward_m * ones, arm.right_m * ones, arm.down_m * ones, roll, pitch, heading)
        lat, lon, height = displace(lat, lon, height, east, north, up)
        angle, tilt = np.radians(scan.scan_angle_deg[chosen][usable]), math.radians(scan.tilt_deg)
        if scan.stabilised:
            azimuth, elevation = np.radians(heading) + angle, np.full(len(lat), tilt)
        else:
            look = (math.cos(tilt) * np.cos(angle), math.cos(tilt) * np.sin(angle), -math.sin(tilt) * ones)
            east, north, up = body_to_enu(*look, roll, pitch, heading)
            azimuth, elevation = np.arctan2(east, north), np.arcsin(np.clip(up, -1, 1))
        return Pointing(lat, lon, height, azimuth, elevation), usable, reasons

    def _compare(self, scan: Scan, radials: NDArray[np.intp], pointing: Pointing) -> tuple[Comparison, int]:
        s = self.settings
        bins = scan.bins.shape[1]
        limit = bins if s.range_limit_nm is None else max(1, min(bins, int(bins * s.range_limit_nm / scan.range_nm)))
        beam = Beam(s.beam_width_deg, s.azimuth_fan, s.azimuth_span, s.refraction_k, s.range_reference)
        dem, void = predict(self.terrain.grid, pointing, limit, scan.range_nm * NM_M / bins, beam)
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
            _share(*unmatched_share(seen, predicted, dem)),
            _share(*unmatched_share(predicted, seen, radar)),
        ), int(np.count_nonzero(void))

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


def thin(scan_angle_deg: NDArray[np.float64], spacing_deg: float) -> NDArray[np.intp]:
    """Indices of one radial for each multiple of `spacing_deg`, the nearest to it, in order of arrival.

    Neighbours within a beam see the same shadow: counted as independent they turn a P_FA of 1e-3 into 0.04.
    """
    cell = np.round(scan_angle_deg / spacing_deg)
    order = np.lexsort((np.abs(scan_angle_deg - cell * spacing_deg), cell))
    return np.sort(order[np.diff(cell[order], prepend=-np.inf) > 0])


def _share(unmatched: int, eligible: int) -> float | None:
    return unmatched / eligible if eligible else None
