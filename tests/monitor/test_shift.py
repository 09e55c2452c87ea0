"""The shift statistic against matrices written out, chi-square, and shifts of a known size."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, kstest

from monitor.calibration import MOST_BINS, EdgeModel, ShiftModel
from monitor.sample import ScanSample, Unmatched
from monitor.shift import (
    LARGEST_BINS,
    largest_statistic,
    mean_shift,
    score,
    shift_statistic,
    shift_threshold,
    with_common_errors,
)

WIDE = EdgeModel(median_bins=0.0, clip_bins=MOST_BINS)  # nothing here is clipped by it
NONE = Unmatched(0, 0)


def scan(d: NDArray[np.float64], azimuth_rad: NDArray[np.float64], size: NDArray[np.float64]) -> ScanSample:
    return ScanSample(d, d, azimuth_rad, size, NONE, NONE, float("nan"))


def model(sigma: float, place: float, stretch: float, edge: EdgeModel = WIDE) -> ShiftModel:
    return ShiftModel(front=edge, back=edge, sigma_bins=sigma, place_bins=place, stretch=stretch)


def flown(
    seed: int,
    truth: ShiftModel,
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
        north, east = np.array(shift) + rng.normal(0, truth.place_bins, 2)
        along = north * np.cos(azimuth) + east * np.sin(azimuth)
        yield scan(rng.normal(0, truth.sigma_bins, pairs) + along + rng.normal(0, truth.stretch) * size, azimuth, size)


def measured(scans: Sequence[ScanSample], sigma: float) -> ShiftModel:
    return with_common_errors(model(sigma, 0.0, 0.0), [score(one, WIDE, WIDE) for one in scans])


def statistic(one: ScanSample, truth: ShiftModel) -> float:
    return shift_statistic(score(one, truth.front, truth.back), truth)


def test_it_is_what_the_matrices_say() -> None:
    """Of disparities that are the means of both edges about their own medians."""
    front, back = (EdgeModel(median_bins=median, clip_bins=MOST_BINS) for median in (0.5, -1.0))
    truth = model(2.0, 0.5, 0.02).model_copy(update={"front": front, "back": back})
    one = next(flown(1, truth, (1.0, -2.0), pairs=25))
    one = one._replace(front=one.disparities + one.size / 8, back=one.disparities - one.size / 8)
    a = np.stack([np.cos(one.azimuth_rad), np.sin(one.azimuth_rad)], axis=1)
    disparities = 2.0**2 * np.eye(25) + 0.5**2 * a @ a.T + 0.02**2 * np.outer(one.size, one.size)
    g = a.T @ (one.disparities + 0.25)
    expected = g @ np.linalg.inv(a.T @ disparities @ a) @ g
    assert statistic(one, truth) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("truth", [model(2.0, 0.6, 0.0), model(2.0, 0.0, 0.1)])
def test_without_a_fault_it_is_chi_square_with_two_degrees_of_freedom(truth: ShiftModel) -> None:
    found = [statistic(one, truth) for one in flown(2, truth, scans=4000)]
    assert kstest(found, chi2(2).cdf).pvalue > 0.01


@pytest.mark.parametrize("p_fa", [0.1, 1e-3, 1e-5])
def test_the_threshold_is_a_quantile_of_that(p_fa: float) -> None:
    assert shift_threshold(p_fa) == pytest.approx(chi2.isf(p_fa, 2), rel=1e-12)


@pytest.mark.parametrize("edge", ["front", "back"])
def test_an_edge_far_off_counts_no_more_than_the_clip_and_leaves_the_other_edge_alone(edge: str) -> None:
    truth = model(1.0, 0.3, 0.0, EdgeModel(median_bins=0.0, clip_bins=3.0))
    plain = scan(np.full(20, 0.5), np.linspace(0, 1, 20), np.full(20, 5.0))
    far, at_the_clip = (
        statistic(plain._replace(**{edge: np.r_[off, np.full(19, 0.5)]}), truth) for off in (500.0, 3.0)
    )
    assert far == at_the_clip != statistic(plain, truth)


def test_radials_all_at_one_azimuth_say_nothing_across_it() -> None:
    one = scan(np.full(16, 1.5), np.full(16, 0.7), np.full(16, 5.0))
    along = 16 * 1.5**2 / (1 + 0.5**2 * 16)  # the mean against its own variance, and no second component
    assert statistic(one, model(1.0, 0.5, 0.0)) == pytest.approx(along, rel=1e-9)


def test_a_shift_that_the_sum_of_squares_does_not_show_is_found() -> None:
    truth = model(1.7, 0.1, 0.0)
    scans = list(flown(3, truth, (1.5, 0.0), scans=400))
    found = np.mean([statistic(one, truth) > shift_threshold(1e-4) for one in scans])
    squares = np.mean([np.sum(one.disparities**2) / 1.7**2 > chi2.isf(1e-4, 40) for one in scans])
    assert found > 2 * squares


def test_no_shift_raises_it_above_that_of_clipped_edges() -> None:
    truth = model(1.0, 0.3, 0.0, EdgeModel(median_bins=0.5, clip_bins=3.0))
    plain = next(flown(6, truth))
    most = largest_statistic(plain, truth)
    toward = np.arange(8) * np.pi / 8
    shifted = (plain.disparities + 1e3 * np.cos(plain.azimuth_rad - angle) for angle in toward)
    assert max(statistic(plain._replace(front=d, back=d), truth) for d in shifted) == pytest.approx(most, rel=1e-12)


@pytest.mark.parametrize(("place", "stretch"), [(0.2, 0.0), (1.0, 0.0), (0.3, 0.1), (0.0, 0.2)])
def test_the_errors_in_common_are_measured(place: float, stretch: float) -> None:
    scans = list(flown(4, model(1.5, place, stretch), scans=4000))
    made = measured(scans, 1.5)
    # A shift moves all disparities of a sector together, which looks like a little stretch.
    assert made.stretch == pytest.approx(stretch, rel=0.05, abs=0.03 if not stretch else 0.0)
    assert made.place_bins == pytest.approx(place, rel=0.15, abs=0.1)
    assert np.mean([statistic(one, made) for one in scans]) == pytest.approx(2.0, rel=0.01)


def test_scans_that_their_scatter_explains_have_no_error_in_common() -> None:
    scans = list(flown(5, model(1.5, 0.0, 0.0), scans=200))
    assert measured(scans, 1.6) == model(1.6, 0.0, 0.0)


def test_no_error_in_common_is_larger_than_any_receivers() -> None:
    one = scan(np.full(10, 250.0), np.linspace(0, 1, 10), np.resize([1.0, -1.0], 10))
    assert measured([one] * 3, 1.0).place_bins == LARGEST_BINS


def test_the_mean_shift_is_the_one_that_the_scans_have_within_its_standard_errors() -> None:
    shift, truth = (1.5, -0.7), model(2.0, 0.5, 0.0)
    shifts = []
    for seed in range(200):
        found = mean_shift([score(one, WIDE, WIDE) for one in flown(seed, truth, shift, scans=50)])
        shifts.append((found.bins - np.array(shift)) / found.stderr_bins)
    assert np.abs(np.mean(shifts, axis=0)).max() < 3 / np.sqrt(200)
    assert np.std(shifts, axis=0) == pytest.approx(1.0, abs=0.15)


def test_the_certainty_of_a_mean_shift_is_chi_square_where_there_is_none() -> None:
    found = [
        mean_shift([score(one, WIDE, WIDE) for one in flown(seed, model(2.0, 0.5, 0.0), scans=200)]).statistic
        for seed in range(300)
    ]
    assert kstest(found, chi2(2).cdf).pvalue > 0.01
