"""The shift statistic against matrices written out, chi-square, and shifts of a known size."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, kstest

from monitor.calibration import CommonErrors
from monitor.sample import ScanSample, Unmatched
from monitor.shift import LARGEST_BINS, common_errors, mean_shift, score, shift_statistic, shift_threshold

WIDE = 1e9  # a clip that clips nothing
NONE = Unmatched(0, 0)


def scan(d: NDArray[np.float64], azimuth_rad: NDArray[np.float64], size: NDArray[np.float64]) -> ScanSample:
    return ScanSample(d, azimuth_rad, size, NONE, NONE, float("nan"))


def flown(
    seed: int,
    sigma: float,
    common: CommonErrors,
    shift: tuple[float, float] = (0.0, 0.0),
    scans: int = 1,
    pairs: int = 40,
) -> Iterator[ScanSample]:
    """Scans whose position and height are each wrong by one draw for all pairs of a scan."""
    rng = np.random.default_rng(seed)
    for _ in range(scans):
        azimuth, size = (
            rng.uniform(-1, 1, pairs) + rng.uniform(0, 2 * np.pi),
            rng.geometric(0.06, pairs).astype(np.float64) + 2,
        )
        north, east = np.array(shift) + rng.normal(0, common.place_bins, 2)
        along = north * np.cos(azimuth) + east * np.sin(azimuth)
        yield scan(rng.normal(0, sigma, pairs) + along + rng.normal(0, common.stretch) * size, azimuth, size)


def statistic(one: ScanSample, sigma: float, common: CommonErrors, median: float = 0.0, clip: float = WIDE) -> float:
    return shift_statistic(score(one, median, clip), sigma, common)


def test_it_is_what_the_matrices_say() -> None:
    common = CommonErrors(place_bins=0.5, stretch=0.02)
    one = next(flown(1, 2.0, common, (1.0, -2.0), pairs=25))
    a = np.stack([np.cos(one.azimuth_rad), np.sin(one.azimuth_rad)], axis=1)
    disparities = 2.0**2 * np.eye(25) + 0.5**2 * a @ a.T + 0.02**2 * np.outer(one.size, one.size)
    g = a.T @ (one.disparities - 0.25)
    expected = g @ np.linalg.inv(a.T @ disparities @ a) @ g
    assert statistic(one, 2.0, common, median=0.25) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("common", [CommonErrors(place_bins=0.6, stretch=0.0), CommonErrors(place_bins=0, stretch=0.1)])
def test_without_a_fault_it_is_chi_square_with_two_degrees_of_freedom(common: CommonErrors) -> None:
    found = [statistic(one, 2.0, common) for one in flown(2, 2.0, common, scans=4000)]
    assert kstest(found, chi2(2).cdf).pvalue > 0.01


@pytest.mark.parametrize("p_fa", [0.1, 1e-3, 1e-5])
def test_the_threshold_is_a_quantile_of_that(p_fa: float) -> None:
    assert shift_threshold(p_fa) == pytest.approx(chi2.isf(p_fa, 2), rel=1e-12)


def test_a_disparity_far_off_counts_no_more_than_the_clip() -> None:
    common = CommonErrors(place_bins=0.3, stretch=0.0)
    d = np.full(20, 0.5)
    far, at_the_clip = d.copy(), d.copy()
    far[0], at_the_clip[0] = 500.0, 3.0
    scans = (scan(some, np.linspace(0, 1, 20), np.full(20, 5.0)) for some in (far, at_the_clip))
    found, expected = (statistic(one, 1.0, common, clip=3.0) for one in scans)
    assert found == expected


def test_radials_all_at_one_azimuth_say_nothing_across_it() -> None:
    one = scan(np.full(16, 1.5), np.full(16, 0.7), np.full(16, 5.0))
    along = 16 * 1.5**2 / (1 + 0.5**2 * 16)  # the mean against its own variance, and no second component
    assert statistic(one, 1.0, CommonErrors(place_bins=0.5, stretch=0.0)) == pytest.approx(along, rel=1e-9)


def test_a_shift_that_the_sum_of_squares_does_not_show_is_found() -> None:
    common = CommonErrors(place_bins=0.1, stretch=0.0)
    scans = list(flown(3, 1.7, common, (1.5, 0.0), scans=400))
    found = np.mean([statistic(one, 1.7, common) > shift_threshold(1e-4) for one in scans])
    squares = np.mean([np.sum(one.disparities**2) / 1.7**2 > chi2.isf(1e-4, 40) for one in scans])
    assert found > 2 * squares


@pytest.mark.parametrize(("place", "stretch"), [(0.2, 0.0), (1.0, 0.0), (0.3, 0.1), (0.0, 0.2)])
def test_the_errors_in_common_are_measured(place: float, stretch: float) -> None:
    common = CommonErrors(place_bins=place, stretch=stretch)
    scans = [score(one, 0.0, WIDE) for one in flown(4, 1.5, common, scans=4000)]
    made = common_errors(scans, 1.5)
    # A shift moves all disparities of a sector together, which looks like a little stretch.
    assert made.stretch == pytest.approx(stretch, rel=0.05, abs=0.03 if not stretch else 0.0)
    assert made.place_bins == pytest.approx(place, rel=0.15, abs=0.1)
    assert np.mean([shift_statistic(one, 1.5, made) for one in scans]) == pytest.approx(2.0, rel=0.01)


def test_scans_that_their_scatter_explains_have_no_error_in_common() -> None:
    nothing = CommonErrors(place_bins=0.0, stretch=0.0)
    scans = [score(one, 0.0, WIDE) for one in flown(5, 1.5, nothing, scans=200)]
    assert common_errors(scans, 1.6) == nothing


def test_no_error_in_common_is_larger_than_any_receivers() -> None:
    one = scan(np.full(10, 1e6), np.linspace(0, 1, 10), np.resize([1.0, -1.0], 10))
    assert common_errors([score(one, 0.0, WIDE)] * 3, 1.0).place_bins == LARGEST_BINS


def test_the_mean_shift_is_the_one_that_the_scans_have_within_its_standard_errors() -> None:
    truth, common = np.array([1.5, -0.7]), CommonErrors(place_bins=0.5, stretch=0.0)
    shifts = []
    for seed in range(200):
        found = mean_shift([score(one, 0.0, WIDE) for one in flown(seed, 2.0, common, tuple(truth), scans=50)])
        shifts.append((found.bins - truth) / found.stderr_bins)
    assert np.abs(np.mean(shifts, axis=0)).max() < 3 / np.sqrt(200)
    assert np.std(shifts, axis=0) == pytest.approx(1.0, abs=0.15)


def test_the_certainty_of_a_mean_shift_is_chi_square_where_there_is_none() -> None:
    common = CommonErrors(place_bins=0.5, stretch=0.0)
    found = [
        mean_shift([score(one, 0.0, WIDE) for one in flown(seed, 2.0, common, scans=200)]).statistic
        for seed in range(300)
    ]
    assert kstest(found, chi2(2).cdf).pvalue > 0.01
