"""How wide shadows are, by hand and against the definition written as sets of bins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.shade import radar_states, shadows
from monitor.width import are_wide

SPACING_DEG = 3.0
ROWS = st.integers(1, 7).flatmap(
    lambda n: st.lists(st.lists(st.booleans(), min_size=12, max_size=12), min_size=n, max_size=n)
)


def wide(dark: list[tuple[int, int] | None], angles: list[float], minimum_deg: float) -> list[bool]:
    """Of radials with one shadow each, first and last dark bin, or none, which of the shadows are wide."""
    bins = np.ones((len(dark), 30), np.uint8)
    for radial, shadow in zip(bins, dark, strict=True):
        if shadow:
            radial[shadow[0] - 1 : shadow[1]] = 0
    found = shadows(radar_states(bins), "radar")
    return [bool(one) for one in are_wide(found, np.array(angles, float), SPACING_DEG, minimum_deg)]


def test_three_radials_three_degrees_apart_make_six_degrees() -> None:
    dark: list[tuple[int, int] | None] = [(5, 9), (7, 12), (9, 10)]
    assert wide(dark, [-3, 0, 3], 6.0) == [True, True, True]
    assert wide(dark, [-3, 0, 3], 6.001) == [False] * 3


def test_neighbours_must_overlap_the_shadow_itself() -> None:
    """A slanting row: each overlaps the next one only, so that only the middle one has both neighbours."""
    assert wide([(5, 9), (9, 14), (14, 18)], [-3, 0, 3], 6.0) == [False, True, False]
    assert wide([(5, 9), (10, 14)], [0, 3], 3.0) == [False, False]


def test_a_radial_without_the_shadow_or_left_out_ends_the_row() -> None:
    assert wide([(5, 9), None, (5, 9), (5, 9)], [0, 3, 6, 9], 3.0) == [False, True, True]
    assert wide([(5, 9), (5, 9), (5, 9), (5, 9)], [0, 6, 9, 12], 6.0) == [False, True, True, True]


def test_a_row_goes_on_across_the_tail_and_with_a_radar_of_wide_steps() -> None:
    assert wide([(5, 9)] * 3, [177, -180, -177], 6.0) == [True] * 3
    assert wide([(5, 9)] * 3, [0, 7, 14], 14.0) == [True] * 3


def test_a_shadow_that_runs_to_the_last_bin_reaches_as_far_as_it() -> None:
    assert wide([(20, 30), (30, 30)], [0, 3], 3.0) == [True, True]


def test_without_a_neighbour_or_an_angle_a_shadow_has_no_width() -> None:
    assert wide([(5, 9)], [0], 0.001) == [False]
    assert wide([(5, 9)] * 3, [0, np.nan, 6], 3.0) == [False] * 3
    assert wide([], [], 3.0) == []


@given(ROWS, st.sampled_from([3.0, 6.0, 12.0]))
def test_widths_are_those_of_the_definition(lit: list[list[bool]], minimum_deg: float) -> None:
    found = shadows(radar_states(np.array(lit, np.uint8)), "radar")
    dark = [
        (int(s["radial"]), set(range(s["front"] + 1, s["back"] + bool(s["range_limited"])))) for s in found
    ]  # bins between the edges, the last one too where there is no back edge
    expected = []
    for radial, bins in dark:
        shared = {other for other, its in dark if its & bins}
        row = {radial}
        for way in (-1, 1):
            at = radial + way
            while at in shared:
                row.add(at)
                at += way
        expected.append((max(row) - min(row)) * SPACING_DEG >= minimum_deg)
    angles: NDArray[np.float64] = np.arange(len(lit), dtype=np.float64) * SPACING_DEG
    assert are_wide(found, angles, SPACING_DEG, minimum_deg).tolist() == expected
    assert are_wide(found, -angles, SPACING_DEG, minimum_deg).tolist() == expected


@pytest.mark.parametrize("shadow_count", [0, 3])
def test_no_minimum_leaves_every_shadow(shadow_count: int) -> None:
    assert wide([(5, 9)] * shadow_count, list(range(shadow_count)), 0.0) == [True] * shadow_count
