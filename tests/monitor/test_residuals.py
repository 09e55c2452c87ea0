"""Residuals of shadows that are written down bin by bin, and their moments."""

import statistics

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from monitor.residuals import (
    Residuals,
    correlation,
    moments,
    normality,
    residuals,
    sigma_of_independent_edges,
)

ANY_SIZE = (1, 64)


def states(*radials: str) -> NDArray[np.int8]:
    """A bin a letter: lit (#), dark (.)."""
    return np.array([[1 if letter == "#" else 0 for letter in radial] for radial in radials], np.int8)


def test_edges_centre_and_size_are_measured_minus_reference() -> None:
    """Front 5 against 4 and back 9 against 10: centre 7 against 7, size 3 against 5."""
    found = residuals(states("#####...####"), states("####.....###"), ANY_SIZE, "overlap")
    assert [values.tolist() for values in (*found, found.centre, found.size)] == [[1], [-1], [0], [-2]]


def test_a_centre_may_lie_between_two_bins() -> None:
    found = residuals(states("#####...####"), states("#####....###"), ANY_SIZE, "overlap")
    assert found.centre.tolist() == [-0.5]


def test_shadows_pair_by_overlap_or_the_first_with_the_first() -> None:
    measured, reference = states("##.##....###"), states("######...###")
    by_overlap = residuals(measured, reference, ANY_SIZE, "overlap")
    first = residuals(measured, reference, ANY_SIZE, "first")
    assert (by_overlap.front.tolist(), by_overlap.back.tolist()) == ([-1], [0])
    assert (first.front.tolist(), first.back.tolist()) == ([-4], [-6])


def test_the_first_of_those_of_the_sizes_asked_for_counts() -> None:
    measured, reference = states("##.##....###"), states("######...###")
    assert residuals(measured, reference, (3, 64), "first").front.tolist() == [-1]
    assert residuals(measured, reference, (1, 3), "first").front.tolist() == [-4]
    assert residuals(measured, reference, (5, 64), "first").front.tolist() == []


def test_radials_on_which_one_thread_has_no_shadow_give_nothing() -> None:
    measured = states("############", "###..#######", "####...#####")
    reference = states("###..#######", "############", "###....#####")
    for found in (residuals(measured, reference, ANY_SIZE, pairing) for pairing in ("overlap", "first")):
        assert (found.front.tolist(), found.back.tolist()) == ([1], [0])


def test_a_shadow_without_a_back_edge_gives_nothing() -> None:
    for pairing in ("overlap", "first"):
        assert residuals(states("####........"), states("####......##"), ANY_SIZE, pairing).front.size == 0


def test_residuals_reach_as_far_as_the_note_to_table_5_says() -> None:
    """64 bins, size 3 at least: F 1..60, B 5..64, C 3..62, so residuals of -59..59."""
    near, far = states("#...############################################################"), states("#" * 60 + "...#")
    for measured, reference, extreme in ((near, far, -59), (far, near, 59)):
        found = residuals(measured, reference, (3, 64), "first")
        assert [values.tolist() for values in (*found, found.centre, found.size)] == [
            [extreme],
            [extreme],
            [extreme],
            [0],
        ]


def test_moments_are_those_of_the_standard_library() -> None:
    values = [0.5, -3.0, 2.0, 11.5, 0.0]
    n, mean, sigma = moments(np.array(values))
    assert n == 5
    assert mean == pytest.approx(statistics.mean(values), rel=1e-12)
    assert sigma == pytest.approx(statistics.stdev(values), rel=1e-12)
    assert moments(np.empty(0)) == (0, None, None)
    assert moments(np.ones(1)) == (1, 1.0, None)


def test_normal_residuals_fail_the_test_of_normality_as_often_as_its_p_value_says() -> None:
    rng = np.random.default_rng(4)
    failed = sum((normality(rng.normal(1, 3, 500)) or 0) < 0.05 for _ in range(400))
    assert binom.ppf(0.001, 400, 0.05) <= failed <= binom.ppf(0.999, 400, 0.05)


def test_heavy_tails_fail_the_test_of_normality() -> None:
    heavy = normality(np.random.default_rng(4).standard_t(2, 500))
    assert heavy is not None
    assert heavy < 1e-6
    assert normality(np.zeros(500)) is None
    assert normality(np.arange(19.0)) is None


def test_the_sigma_of_equation_11_and_the_correlation_make_up_that_of_the_centres() -> None:
    """Var((F + B) / 2) = (var F + var B + 2 r sigma_F sigma_B) / 4, whatever the distribution."""
    rng = np.random.default_rng(2)
    front = rng.normal(0, 3.34, 300)
    found = Residuals(front, 0.5 * front + rng.normal(0, 4.7, 300))
    by_11, r = sigma_of_independent_edges(found), correlation(found)
    sigma_front, sigma_back, sigma_centre = (moments(x).sigma for x in (found.front, found.back, found.centre))
    assert by_11 and r and sigma_front and sigma_back and sigma_centre
    assert sigma_centre**2 == pytest.approx(by_11**2 + r * sigma_front * sigma_back / 2, rel=1e-12)
    assert r > 0.2


def test_table_5_has_a_centre_that_equation_11_does_not_give() -> None:
    """The 1800 m row: edges of 3.34 and 5.04 bins, independent, would give 3.02; the paper measured 3.58."""
    unit = np.array([-1.0, 1.0]) / np.sqrt(2)  # of standard deviation 1
    assert sigma_of_independent_edges(Residuals(3.34 * unit, 5.04 * unit)) == pytest.approx(3.02, abs=0.005)


def test_edges_that_do_not_move_have_no_correlation() -> None:
    assert correlation(Residuals(np.zeros(5), np.arange(5.0))) is None
    assert correlation(Residuals(np.zeros(1), np.zeros(1))) is None
