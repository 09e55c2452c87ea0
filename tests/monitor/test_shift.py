"""The shift statistic against matrices written out, chi-square, and shifts of a known size."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, kstest

from monitor.shift import LARGEST_BINS, common_error, shift_statistic, shift_threshold

WIDE = 1e9  # a clip that clips nothing


def flown(
    rng: np.random.Generator,
    pairs: int,
    sigma: float,
    common: float,
    shift: tuple[float, float] = (0.0, 0.0),
    scans: int = 1,
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Disparities and azimuths of scans whose position is wrong by one draw for all pairs of a scan."""
    for _ in range(scans):
        azimuth = rng.uniform(-1, 1, pairs) + rng.uniform(0, 2 * np.pi)
        north, east = np.array(shift) + rng.normal(0, common, 2)
        yield rng.normal(0, sigma, pairs) + north * np.cos(azimuth) + east * np.sin(azimuth), azimuth


def test_it_is_what_the_matrices_say() -> None:
    rng = np.random.default_rng(1)
    (d, azimuth), *_ = flown(rng, 25, 2.0, 0.5, (1.0, -2.0))
    a = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    fitted, *_ = np.linalg.lstsq(a, d - 0.25, rcond=None)
    covariance = 2.0**2 * np.linalg.inv(a.T @ a) + 0.5**2 * np.eye(2)
    expected = fitted @ np.linalg.inv(covariance) @ fitted
    assert shift_statistic(d, azimuth, 0.25, WIDE, 2.0, 0.5) == pytest.approx(expected, rel=1e-9)


def test_without_a_fault_it_is_chi_square_with_two_degrees_of_freedom() -> None:
    rng = np.random.default_rng(2)
    found = [shift_statistic(*scan, 0.0, WIDE, 2.0, 0.6) for scan in flown(rng, 30, 2.0, 0.6, scans=4000)]
    assert kstest(found, chi2(2).cdf).pvalue > 0.01


@pytest.mark.parametrize("p_fa", [0.1, 1e-3, 1e-5])
def test_the_threshold_is_a_quantile_of_that(p_fa: float) -> None:
    assert shift_threshold(p_fa) == pytest.approx(-2 * np.log(p_fa), rel=1e-9)  # exact for two degrees of freedom


def test_a_disparity_far_off_counts_no_more_than_the_clip() -> None:
    azimuth = np.zeros(20)
    d = np.full(20, 0.5)
    far, at_the_clip = d.copy(), d.copy()
    far[0], at_the_clip[0] = 500.0, 3.0
    found, expected = (shift_statistic(some, azimuth, 0.0, 3.0, 1.0, 0.3) for some in (far, at_the_clip))
    assert found == expected


def test_radials_all_at_one_azimuth_say_nothing_across_it() -> None:
    d, azimuth = np.full(16, 1.5), np.full(16, 0.7)
    along = 16 * 1.5**2 / (1 + 0.5**2 * 16)  # the mean against its own variance, and no second component
    assert shift_statistic(d, azimuth, 0.0, WIDE, 1.0, 0.5) == pytest.approx(along, rel=1e-9)


def test_a_shift_that_the_sum_of_squares_does_not_show_is_found() -> None:
    rng = np.random.default_rng(3)
    scans = list(flown(rng, 40, 1.7, 0.1, (1.5, 0.0), scans=400))
    found = np.mean([shift_statistic(*scan, 0.0, WIDE, 1.7, 0.1) > shift_threshold(1e-4) for scan in scans])
    squares = np.mean([np.sum(d**2) / 1.7**2 > chi2.isf(1e-4, 40) for d, _ in scans])
    assert found > 2 * squares


@pytest.mark.parametrize("common", [0.2, 1.0])
def test_the_common_error_of_the_scans_is_measured(common: float) -> None:
    rng = np.random.default_rng(4)
    scans = list(flown(rng, 40, 1.5, common, scans=3000))
    assert common_error(scans, 0.0, WIDE, 1.5) == pytest.approx(common, rel=0.05)


def test_scans_that_their_scatter_explains_have_no_common_error() -> None:
    rng = np.random.default_rng(5)
    scans = list(flown(rng, 40, 1.5, 0.0, scans=200))
    assert common_error(scans, 0.0, WIDE, 1.6) == 0.0


def test_no_common_error_is_larger_than_any_receivers() -> None:
    scans = [(np.full(10, 1e6), np.linspace(0, 1, 10))] * 3
    assert common_error(scans, 0.0, WIDE, 1.0) == LARGEST_BINS
