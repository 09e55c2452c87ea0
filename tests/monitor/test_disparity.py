"""T, the robust Q and their thresholds: Table 2 of the paper, exact arithmetic, and the false alerts that result."""

from fractions import Fraction
from math import log10, sqrt

import numpy as np
import pytest
from scipy.special import gammaincc
from scipy.stats import binom, chi2, ncx2

from monitor.disparity import (
    clipped,
    minimum_detectable_bias,
    normalised,
    robust_statistic,
    robust_threshold,
    statistic,
    threshold,
)

TABLE_2 = [  # N_D, sigma_C, P_FA, P_MD, MDB, T_D
    (60, 2, 1e-1, 1e-5, 3.53, 74.40),
    (60, 2, 1e-3, 1e-3, 3.70, 99.61),
    (60, 2, 1e-5, 1e-1, 3.38, 118.58),
    (120, 4, 1e-1, 1e-5, 5.64, 140.23),
    (120, 4, 1e-3, 1e-3, 5.92, 173.62),
    (120, 4, 1e-5, 1e-1, 5.43, 197.83),
]
D = [Fraction(n, 2) for n in (-7, -3, -1, 0, 1, 1, 2, 4, 9, 25)]


@pytest.mark.parametrize(("n", "sigma_c", "p_fa", "p_md", "mdb", "t_d"), TABLE_2)
def test_table_2_is_reproduced_to_its_two_decimals(
    n: int, sigma_c: int, p_fa: float, p_md: float, mdb: float, t_d: float
) -> None:
    sigma_d = sqrt(2) * sigma_c  # eq. (8), both threads alike
    assert round(threshold(n, p_fa), 2) == t_d
    assert round(minimum_detectable_bias(n, sigma_d, p_fa, p_md), 2) == mdb


@pytest.mark.parametrize(("n", "sigma_c", "p_fa", "p_md", "mdb", "t_d"), TABLE_2)
def test_the_minimum_detectable_bias_is_missed_with_the_stated_probability(
    n: int, sigma_c: int, p_fa: float, p_md: float, mdb: float, t_d: float
) -> None:
    bias = minimum_detectable_bias(n, sqrt(2) * sigma_c, p_fa, p_md)
    noncentrality = n * bias**2 / (2 * sigma_c**2)
    assert float(ncx2.cdf(chi2.isf(p_fa, n), n, noncentrality)) == pytest.approx(p_md, rel=1e-6)


def test_the_minimum_detectable_bias_scales_with_sigma_and_is_zero_where_chance_alone_alerts_often_enough() -> None:
    small, large = (minimum_detectable_bias(40, sigma, 1e-4, 1e-3) for sigma in (1.0, 3.0))
    assert large == pytest.approx(3 * small, rel=1e-12)
    assert minimum_detectable_bias(40, 2.0, 0.1, 0.95) == 0.0


def test_t_is_the_mean_square_in_exact_arithmetic() -> None:
    exact = sum(d * d for d in D) / len(D)
    assert exact == Fraction(787, 40)
    assert statistic([float(d) for d in D]) == float(exact)
    assert normalised([float(d) for d in D], 2.5) == float(len(D) * exact / Fraction(25, 4))


def test_t_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        statistic([])


def test_comparing_t_in_square_bins_with_t_d_would_never_alert() -> None:
    """Table 2 prints T_D "in range bins"; in its first configuration P_FA = 0.1 would become 7e-82."""
    n, sigma_d_squared = 60, 8
    literal = float(chi2.sf(n * threshold(n, 1e-1) / sigma_d_squared, n))
    assert -82 < log10(literal) < -81
    t = 9.98  # bins^2, a mean square a quarter above sigma_D^2
    d = np.full(n, sqrt(t))
    assert statistic(d) < threshold(n, 1e-1) < normalised(d, sqrt(8))
    assert normalised(d, sqrt(8)) == pytest.approx(n * t / 8)


def test_the_robust_statistic_clips_about_the_median_in_exact_arithmetic() -> None:
    median, clip, sigma = Fraction(1, 2), Fraction(4), Fraction(3, 2)
    held = [max(-clip, min(clip, d - median)) for d in D]
    assert [float(h) for h in held] == [-4.0, -2.0, -1.0, -0.5, 0.0, 0.0, 0.5, 1.5, 4.0, 4.0]
    assert clipped([float(d) for d in D], 0.5, 4.0).tolist() == [float(h) for h in held]
    exact = sum(h * h for h in held) / sigma**2
    assert robust_statistic([float(d) for d in D], 0.5, 4.0, 1.5) == pytest.approx(float(exact), rel=1e-15)


@pytest.mark.parametrize("p_fa", [1e-1, 1e-3, 1e-5])
def test_with_a_variance_factor_of_one_the_robust_threshold_is_the_chi_square_one(p_fa: float) -> None:
    assert robust_threshold(37, p_fa, 1.0) == threshold(37, p_fa)
    assert float(gammaincc(37 / 2, robust_threshold(37, p_fa, 1.0) / 2)) == pytest.approx(p_fa, rel=1e-9)


def test_a_variance_factor_stretches_chi_square_and_keeps_its_mean() -> None:
    """c times chi-square with N / c degrees of freedom has the mean N and the variance 2 c N."""
    limit = robust_threshold(40, 1e-3, 1.6)
    assert float(gammaincc(40 / 1.6 / 2, limit / 1.6 / 2)) == pytest.approx(1e-3, rel=1e-9)
    assert limit > threshold(40, 1e-3)


@pytest.mark.parametrize("p_fa", [1e-1, 1e-2, 1e-3])
def test_normal_disparities_alert_as_often_as_configured(p_fa: float) -> None:
    n, sigma_d, scans = 60, 2.83, 20_000
    limit = threshold(n, p_fa)
    disparities = np.random.default_rng(3).normal(0, sigma_d, (scans, n))
    alerts = sum(normalised(d, sigma_d) > limit for d in disparities)
    assert binom.ppf(0.005, scans, p_fa) <= alerts <= binom.ppf(0.995, scans, p_fa)


def test_a_minimum_detectable_bias_is_missed_as_often_as_configured() -> None:
    n, sigma_d, scans, p_md = 60, 2.83, 20_000, 1e-2
    bias = minimum_detectable_bias(n, sigma_d, 1e-3, p_md)
    disparities = np.random.default_rng(4).normal(bias, sigma_d, (scans, n))
    missed = sum(normalised(d, sigma_d) <= threshold(n, 1e-3) for d in disparities)
    assert binom.ppf(0.005, scans, p_md) <= missed <= binom.ppf(0.995, scans, p_md)
