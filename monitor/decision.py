"""The tests of one sample, each with its share of the probability of a false alert.

The statistic, T as published or the robust Q, looks at the sizes of the disparities of pairs, and the shift statistic
at their directions. The unmatched shares look at shadows without a partner, so they see what is too far off to pair,
and may alert where there are too few pairs for the others. Small shadows come and go with the roughness of the ground
and are not counted, and a weak signal makes radar shadows where the terrain has none. The shares scatter more than a
binomial would, since shadows of a scan stand or fall together: the threshold is a quantile of the beta-binomial
distribution with the mean m that calibration found, and of the share the variance m (1 - m) (1 / n + rho).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln

from monitor.calibration import Calibration, UnmatchedModel
from monitor.disparity import minimum_detectable_bias, normalised, robust_statistic, robust_threshold, threshold
from monitor.sample import ScanSample, Unmatched
from monitor.settings import MonitorSettings
from monitor.shift import largest_statistic, score, shift_statistic, shift_threshold

LEAST_RHO = 1e-6  # which is a binomial
MOST_PAIRS = 1000  # beyond, no further ones would make Q see
RADAR_SHARE, DEM_SHARE = "the unmatched share of radar shadows", "the unmatched share of terrain shadows"


@dataclass(frozen=True)
class Test:
    """A measured value and what it may reach when nothing is wrong."""

    name: str
    value: float
    limit: float

    @property
    def exceeded(self) -> bool:
        """Whether something is wrong."""
        return not self.value <= self.limit  # of what is no number, too

    def __str__(self) -> str:
        return f"{self.name} {self.value:.4g} exceeds {self.limit:.4g}"


@dataclass(frozen=True)
class Findings:
    """The tests that a sample allows, and the numbers behind them.

    Without the statistic `blind` says why, and no sample is ok; with it the numbers of the published test are told with
    either method.
    """

    statistic: Test | None = None
    blind: str = ""
    shift: Test | None = None
    unmatched_radar: Test | None = None
    unmatched_dem: Test | None = None
    t_normalised: float | None = None
    q: float | None = None
    mdb_bins: float | None = None

    @property
    def alerts(self) -> list[Test]:
        """The tests that found something wrong."""
        return [
            test
            for test in (self.statistic, self.shift, self.unmatched_radar, self.unmatched_dem)
            if test and test.exceeded
        ]


def examine(
    sample: ScanSample, settings: MonitorSettings, calibration: Calibration, gathered: NDArray[np.float64] | None = None
) -> Findings:
    """Put a scan to every test that it and the calibration allow.

    `gathered` are disparities (N,) of this scan and those before it, at which the statistic looks instead.
    """
    c, p_fa = calibration, _shares(settings, calibration)
    d = sample.disparities if gathered is None else gathered
    radar = unmatched_test(RADAR_SHARE, sample.unmatched_radar, c.unmatched_radar, p_fa.radar)
    dem = unmatched_test(DEM_SHARE, sample.unmatched_dem, c.unmatched_dem, p_fa.dem)
    shift = shift_test(sample, c, p_fa.shift) if len(sample.disparities) >= settings.pairs_needed else None
    if len(d) < settings.pairs_needed:
        return Findings(None, f"{len(d)} pairs of shadows, {settings.pairs_needed} needed", None, radar, dem)
    q = robust_statistic(d, c.median_bins, c.clip_bins, c.sigma_bins)
    t = normalised(d, c.rms_bins)
    if settings.method == "robust":
        test = Test("Q", q, robust_threshold(len(d), p_fa.statistic, c.variance_factor))
        most = _most(len(d), c)
        if most <= test.limit and not (shift and c.shift and largest_statistic(sample, c.shift) > shift.limit):
            blind = f"Q reaches {most:.1f} at most, its threshold is {test.limit:.1f}"
            blind += ", and no shift would be found" if shift else ""
            return Findings(None, f"{len(d)} pairs cannot alert at P_FA {settings.p_fa:g}: {blind}", None, radar, dem)
    else:
        test = Test("N T / sigma^2", t, threshold(len(d), p_fa.statistic))
    mdb_bins = minimum_detectable_bias(len(d), c.rms_bins, settings.p_fa, settings.p_md)
    return Findings(test, "", shift, radar, dem, t, q, mdb_bins)


def pairs_for_verdict(settings: MonitorSettings, calibration: Calibration) -> int:
    """The least number of pairs with which the statistic can exceed its threshold."""
    p_fa, least = _shares(settings, calibration).statistic, settings.pairs_needed
    if settings.method == "paper":
        return least
    factor = calibration.variance_factor
    enough = (n for n in range(least, MOST_PAIRS) if _most(n, calibration) > robust_threshold(n, p_fa, factor))
    return next(enough, max(least, MOST_PAIRS))


def _most(pairs: int, calibration: Calibration) -> float:
    """What Q comes to if every pair is clipped."""
    return pairs * (calibration.clip_bins / calibration.sigma_bins) ** 2


class _Shares(NamedTuple):
    """The P_FA of each test."""

    statistic: float
    shift: float
    radar: float
    dem: float


def _shares(settings: MonitorSettings, calibration: Calibration) -> _Shares:
    """The statistic has what the others leave: all of it by the published test, which knows no others.

    A test for which the calibration lacks what it needs has nothing.
    """
    s, c = settings, calibration
    if s.method == "paper":
        return _Shares(s.p_fa, 0.0, 0.0, 0.0)
    shift = 0.0 if c.shift is None else s.shift_budget
    radar, dem = (
        budget if _holds(model, s) else 0.0
        for model, budget in ((c.unmatched_radar, s.unmatched_radar_budget), (c.unmatched_dem, s.unmatched_dem_budget))
    )
    return _Shares(s.p_fa * (1 - shift - radar - dem), s.p_fa * shift, s.p_fa * radar, s.p_fa * dem)


def _holds(model: UnmatchedModel | None, settings: MonitorSettings) -> bool:
    """Whether a model is of the shadows that are counted."""
    return model is not None and model.least_size == settings.unmatched_size


def untested(settings: MonitorSettings, calibration: Calibration) -> list[str]:
    """What a calibration does not allow to be tested or compared although the settings would have it, and why."""
    name, found = calibration.name, []
    limits = {"signal levels": calibration.level, "heights above the ground": calibration.height_m}
    unsaid = [what for what, limit in limits.items() if limit is None]
    unsaid += sorted(settings.shaping.keys() - calibration.options.keys())
    if unsaid:
        found.append(f"calibration {name} does not say for which {', '.join(unsaid)} it holds: make it anew")
    if settings.method == "paper":
        return found
    if calibration.shift is None and settings.shift_budget:
        found.append(f"shifts are not tested: calibration {name} does not say how shadows lie, make it anew")
    model = calibration.unmatched_dem
    if settings.unmatched_dem_budget and not _holds(model, settings):
        has = f"those of {model.least_size} bins and more" if model else "none"
        wanted = f"of {settings.unmatched_size} bins and more"
        found.append(f"unmatched terrain shadows {wanted} are not tested: calibration {name} has {has}, make it anew")
    return found


def unmatched_threshold(eligible: int, model: UnmatchedModel, p_fa: float) -> float:
    """The share that so many eligible shadows exceed with no more probability than `p_fa` when nothing is wrong.

    1 where few of them cannot tell: that they are all unmatched is then more probable.
    """
    if eligible < 2:
        return 1.0
    rho = max(model.overdispersion * eligible / (eligible - 1), LEAST_RHO)
    if rho >= 1:
        return 1.0
    a, b = model.mean * (1 / rho - 1), (1 - model.mean) * (1 / rho - 1)
    k = np.arange(eligible + 1)
    ways = -betaln(eligible - k + 1, k + 1) - np.log(eligible + 1)
    of_k = np.exp(ways + betaln(k + a, eligible - k + b) - betaln(a, b))
    more = np.append(np.cumsum(of_k[:0:-1])[::-1], 0.0)  # probability of more than k, small ones summed first
    return float(np.argmax(more <= p_fa) / eligible)


def shift_test(sample: ScanSample, c: Calibration, p_fa: float) -> Test | None:
    """Whether the disparities of a scan follow a shift; None without a share, or what a calibration needs for it."""
    if c.shift is None or not p_fa:
        return None
    found = shift_statistic(score(sample, c.shift.front, c.shift.back), c.shift)
    return Test("the shift statistic", found, shift_threshold(p_fa))


def unmatched_test(name: str, found: Unmatched, model: UnmatchedModel | None, p_fa: float) -> Test | None:
    """Whether more shadows are unmatched than when nothing is wrong; None without a share, a model or any shadow."""
    if model is None or not p_fa or found.share is None:
        return None
    return Test(name, found.share, unmatched_threshold(found.eligible, model, p_fa))
