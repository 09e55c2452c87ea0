"""The fit to fault-free scans whose distribution is known."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import betabinom, binom, norm

from monitor.calibration import CLIP_FACTOR, Calibration, Limits
from monitor.fitting import fit
from monitor.sample import ScanSample, Unmatched
from monitor.settings import MonitorSettings

Scans = list[NDArray[np.float64]]
RNG_SEED = 6
MEDIAN, SPREAD = 0.5, 2.0
NONE = Unmatched(0, 0)
SETTINGS = MonitorSettings(minimum_pairs=16)


RADAR: Any = {"bins": 512, "range_nm": 10.0, "radar_profile": "arinc708"}


def normal_scans(scans: int, n: int = 50, common: float = 0.0) -> Scans:
    """Independent normal disparities, and an error that all disparities of a scan have in common."""
    rng = np.random.default_rng(RNG_SEED)
    return list(rng.normal(MEDIAN, SPREAD, (scans, n)) + rng.normal(0, common, (scans, 1)))


def fitted(scans: Scans, check: Scans | None = None, p_fas: tuple[float, ...] = ()) -> Calibration:
    """To scans whose shadows all have partners."""
    fitting, checking = (
        [ScanSample(d, d, np.zeros(len(d)), np.ones(len(d)), NONE, NONE, np.nan) for d in some]
        for some in (scans, check or [])
    )
    return fit(fitting, checking, p_fas, SETTINGS, name="made", provenance="drawn", **RADAR)


def test_normal_disparities_give_back_their_parameters() -> None:
    """Their median and spread, the rms of a normal clipped at two sigma, and a variance factor near 1.

    With u = 2: E[clip(z)^2] = erf part (1 - 2 phi-tail) - 2 u pdf(u) + 2 u^2 sf(u). Each within four standard errors
    of 50,000 draws, the spread's being 1.17 sigma / sqrt(n).
    """
    found = fitted(normal_scans(1000))
    draws = 50_000
    assert found.median_bins == pytest.approx(MEDIAN, abs=4 * 1.2533 * SPREAD / np.sqrt(draws))
    assert found.spread_bins == pytest.approx(SPREAD, abs=4 * 1.17 * SPREAD / np.sqrt(draws))
    u = CLIP_FACTOR
    clipped_variance = (norm.cdf(u) - norm.cdf(-u)) - 2 * u * norm.pdf(u) + 2 * u**2 * norm.sf(u)
    assert found.sigma_bins == pytest.approx(SPREAD * np.sqrt(clipped_variance), rel=0.02)
    assert found.rms_bins == pytest.approx(np.hypot(MEDIAN, SPREAD), rel=0.02)
    assert found.clip_bins == 2 * found.spread_bins
    assert 1.0 <= found.variance_factor < 1.05


def test_an_error_common_to_a_scan_raises_the_variance_factor() -> None:
    """Clipping leaves Q of a normal a variance below chi-square's, so that the factor begins at its floor of 1."""
    alone, some, much = (fitted(normal_scans(1000, common=c)).variance_factor for c in (0.0, 1.0, 1.5))
    assert alone == 1.0
    assert 1.5 < some < much


def test_the_variance_factor_is_the_scatter_of_q_about_n_over_twice_n() -> None:
    """c = E[(Q - N)^2] / E[2 N], over scans of different size."""
    scans = normal_scans(300, 40, common=1.5) + normal_scans(200, 60, common=1.5)
    found = fitted(scans)
    clip = 2 * found.spread_bins
    scatter = [
        (sum(max(-clip, min(clip, d - found.median_bins)) ** 2 for d in scan) / found.sigma_bins**2 - len(scan)) ** 2
        for scan in (scan.tolist() for scan in scans)
    ]
    assert found.variance_factor == pytest.approx(sum(scatter) / (2 * (300 * 40 + 200 * 60)), rel=1e-9)
    assert found.variance_factor > 2


def test_heavy_tails_move_the_rms_but_hardly_the_robust_numbers() -> None:
    """Every twentieth disparity is a wrong pairing, forty bins off."""
    scans = normal_scans(1000)
    for scan in scans:
        scan[::20] += 40
    clean, found = fitted(normal_scans(1000)), fitted(scans)
    assert found.rms_bins > 3 * clean.rms_bins
    assert found.spread_bins == pytest.approx(clean.spread_bins, rel=0.15)
    assert found.sigma_bins == pytest.approx(clean.sigma_bins, rel=0.25)


def test_wrong_pairings_that_gather_in_some_scans_raise_the_variance_factor() -> None:
    scans = normal_scans(1000)
    for scan in scans[::5]:
        scan[:15] += 40
    assert fitted(scans).variance_factor > 1.2


def test_the_checked_rates_are_those_of_scans_that_the_fit_did_not_see() -> None:
    scans = normal_scans(4000)
    found = fitted(scans[:2000], scans[2000:], (0.1, 0.01))
    assert [(rate.p_fa, rate.scans) for rate in found.checked] == [(0.1, 2000), (0.01, 2000)]
    # Clipping a normal leaves Q less variance than chi-square has: fewer alerts than configured, never more.
    for rate in found.checked:
        assert rate.alerts <= binom.ppf(0.995, rate.scans, rate.p_fa)
    shifted = [scan + 6 for scan in scans[2000:]]
    assert [rate.alerts for rate in fitted(scans[:2000], shifted, (0.01,)).checked] == [2000]


def test_scans_with_too_few_pairs_take_no_part() -> None:
    poor = [np.full(15, 1000.0)] * 500
    scans = normal_scans(100)
    found = fitted(scans + poor, scans[:10] + poor, (0.1,))
    assert found.model_copy(update={"checked": ()}) == fitted(scans)
    assert found.checked[0].scans == 10
    with pytest.raises(ValueError, match=r"only 1 scans have 16 pairs.*fly longer"):
        fitted([*poor, scans[0]])


def test_disparities_without_a_spread_are_refused() -> None:
    with pytest.raises(ValueError, match="half of the disparities are equal"):
        fitted([np.r_[np.zeros(30), np.arange(10.0)]] * 3)


def test_edges_of_which_most_are_exact_are_still_not_known_to_less_than_a_bin() -> None:
    """Front edges that never differ, as of coarse bins; all that there is of a disparity is of the back edge."""
    scans = [
        ScanSample(np.zeros(len(d)), d, np.zeros(len(d)), np.ones(len(d)), NONE, NONE, np.nan) for d in normal_scans(20)
    ]
    found = fit(scans, [], (), SETTINGS, name="made", provenance="drawn", **RADAR).shift
    assert found is not None
    back = np.concatenate([scan.back for scan in scans])
    spread = np.median(np.abs(back - np.median(back))) / norm.ppf(0.75)
    assert (found.front.median_bins, found.front.clip_bins) == (0.0, 1.0)
    assert (found.back.median_bins, found.back.clip_bins) == pytest.approx((np.median(back), 2 * spread), rel=1e-12)


def fitted_to_shares(counts: Any, eligible: int, levels: NDArray[np.float64]) -> Calibration:
    scans = [
        ScanSample(d, d, np.zeros(len(d)), np.ones(len(d)), Unmatched(int(count), eligible), NONE, level)
        for d, count, level in zip(normal_scans(len(counts)), counts, levels, strict=True)
    ]
    return fit(scans, [], (), SETTINGS, name="made", provenance="drawn", **RADAR)


def test_shares_of_a_beta_binomial_give_back_its_mean_and_overdispersion() -> None:
    """rho of a beta-binomial with parameters a and b is 1 / (a + b + 1): here 1 / 21, about a mean of 0.3."""
    counts = betabinom.rvs(60, 6.0, 14.0, size=4000, random_state=RNG_SEED)
    found = fitted_to_shares(counts, 60, np.full(4000, 2.0))
    assert found.unmatched_dem is None
    assert found.unmatched_radar is not None
    assert found.unmatched_radar.mean == pytest.approx(0.3, abs=0.006)
    # The variance m (1 - m) (1 / n + rho) that this form has instead of m (1 - m) (1 / n + rho (n - 1) / n).
    assert found.unmatched_radar.overdispersion == pytest.approx(59 / 60 / 21, rel=0.08)


def test_shares_of_a_binomial_have_no_overdispersion_but_that_which_is_allowed_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts = binom.rvs(60, 0.3, size=4000, random_state=RNG_SEED)
    allowing = fitted_to_shares(counts, 60, np.full(4000, 2.0)).unmatched_radar
    assert allowing is not None
    assert allowing.overdispersion == 0.03
    monkeypatch.setattr("monitor.fitting.LEAST_OVERDISPERSION", 0.0)
    measured = fitted_to_shares(counts, 60, np.full(4000, 2.0)).unmatched_radar
    assert measured is not None
    assert measured.overdispersion < 0.001


def test_levels_are_limited_by_the_scans_but_half_a_percent_at_either_end() -> None:
    levels = np.r_[np.arange(201.0), np.nan]
    found = fitted_to_shares(np.full(202, 3), 10, levels)
    assert found.level == Limits(lowest=1.0, highest=199.0)
