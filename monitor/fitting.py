"""A calibration from fault-free scans: half of them fit, the other half check.

The fit follows from the heavy tails of real terrain: the median m, a robust spread r (normalised median absolute
deviation), the clip at +-k r, the root mean square sigma of what the clip leaves, and the variance factor
c = E[(Q - N)^2] / E[2 N], which is 1 for independent normal disparities and grows with errors common to a scan. What
of those comes of a wrong position or height is measured apart, for the test for a shift.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from monitor.calibration import CLIP_FACTOR, Calibration, CheckedRate, EdgeModel, Limits, ShiftModel, UnmatchedModel
from monitor.decision import examine
from monitor.disparity import clipped, robust_statistic
from monitor.sample import ScanSample, Unmatched
from monitor.settings import MonitorSettings
from monitor.shift import clipped_centres, score, with_common_errors

QUARTILE = float(ndtri(0.75))  # of a normal distribution: half of it lies nearer to its median
# Of unmatched shadows. Even terrain has less, but a calibration over it must hold over its rougher parts too, and a few
# hundred scans measure it badly.
LEAST_OVERDISPERSION = 0.03
LEFT_OUT = 0.5  # percent of the scans at either end of the limits


def fit(
    scans: Sequence[ScanSample],
    check: Sequence[ScanSample],
    p_fas: Sequence[float],
    settings: MonitorSettings,
    *,
    name: str,
    provenance: str,
    bins: int,
    range_nm: float,
    radar_profile: str,
) -> Calibration:
    """Fit to fault-free scans, and count on other scans how often each P_FA would have alerted.

    Scans with fewer pairs than the settings need are left out, as in flight. Raises ValueError if too few are left.
    """
    minimum_pairs = settings.pairs_needed
    usable = [scan for scan in scans if len(scan.disparities) >= minimum_pairs]
    if len(usable) < 2:
        raise ValueError(
            f"only {len(usable)} scans have {minimum_pairs} pairs: fly longer, lower or over rougher terrain"
        )
    pooled = np.concatenate([scan.disparities for scan in usable])
    median, spread = _robust(pooled)
    if not spread:
        raise ValueError("half of the disparities are equal, so they have no spread: fit to a radar with its noise")
    clip = CLIP_FACTOR * spread
    sigma = _rms(clipped(pooled, median, clip))
    q = np.array([robust_statistic(scan.disparities, median, clip, sigma) for scan in usable])
    n = np.array([len(scan.disparities) for scan in usable])
    made = Calibration(
        name=name,
        provenance=provenance,
        bins=bins,
        range_nm=range_nm,
        radar_profile=radar_profile,
        median_bins=median,
        spread_bins=spread,
        sigma_bins=sigma,
        rms_bins=_rms(pooled),
        variance_factor=max(1.0, float(np.mean((q - n) ** 2) / np.mean(2 * n))),
        shift=_shift(usable),
        unmatched_radar=_shares([scan.unmatched_radar for scan in usable], settings),
        unmatched_dem=_shares([scan.unmatched_dem for scan in usable], settings),
        level=_limits([scan.level for scan in usable]),
        height_m=_limits([scan.height_m for scan in usable]),
        options=settings.shaping,
    )
    held_out = [scan for scan in check if len(scan.disparities) >= minimum_pairs]
    return made.model_copy(update={"checked": tuple(_checked(held_out, made, settings, p_fa) for p_fa in p_fas)})


def _robust(values: NDArray[np.float64]) -> tuple[float, float]:
    """Their median, and the normalised median absolute deviation from it."""
    median = float(np.median(values))
    return median, float(np.median(np.abs(values - median)) / QUARTILE)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _shift(scans: Sequence[ScanSample]) -> ShiftModel:
    front, back = _edge([scan.front for scan in scans]), _edge([scan.back for scan in scans])
    sigma = _rms(np.concatenate([clipped_centres(scan, front, back) for scan in scans]))
    bare = ShiftModel(front=front, back=back, sigma_bins=sigma, place_bins=0, stretch=0)
    return with_common_errors(bare, [score(scan, front, back) for scan in scans])


def _edge(residuals: Sequence[NDArray[np.float64]]) -> EdgeModel:
    """Of coarse bins more than half of the edges may be exact; no edge is known to less than a bin."""
    median, spread = _robust(np.concatenate(residuals))
    return EdgeModel(median_bins=median, clip_bins=max(CLIP_FACTOR * spread, 1.0))


def _checked(scans: Sequence[ScanSample], made: Calibration, settings: MonitorSettings, p_fa: float) -> CheckedRate:
    asked = settings.model_copy(update={"p_fa": p_fa})
    alerts = sum(bool(examine(scan, asked, made).alerts) for scan in scans)
    return CheckedRate(p_fa=p_fa, scans=len(scans), alerts=alerts)


def _shares(found: Sequence[Unmatched], settings: MonitorSettings) -> UnmatchedModel | None:
    """The mean share over scans, and by how much its variance exceeds a binomial's, or may."""
    eligible = np.array([one.eligible for one in found])
    share = np.array([one.alone for one in found])[eligible > 0] / eligible[eligible > 0]
    if share.size < 2 or not 0 < share.mean() < 1:
        return None
    mean = float(share.mean())
    excess = (share - mean) ** 2 / (mean * (1 - mean)) - 1 / eligible[eligible > 0]
    rho = float(np.clip(excess.mean(), LEAST_OVERDISPERSION, 1))
    return UnmatchedModel(mean=mean, overdispersion=rho, least_size=settings.unmatched_size)


def _limits(values: Sequence[float]) -> Limits | None:
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return None
    lowest, highest = np.percentile(known, [LEFT_OUT, 100 - LEFT_OUT])
    return Limits(lowest=float(lowest), highest=float(highest))
