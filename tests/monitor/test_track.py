"""The history of a quantity: what may be interpolated, and what must be admitted as unknown."""

from collections.abc import Sequence

import numpy as np
import pytest

from monitor.track import MISSING, NORMAL, STALE, Quantity, Samples, Track, Values, wrap

NO_COMPUTED_DATA = 1
MS = 1_000_000
SPEED = Quantity("speed", longest_gap_s=1.0)
HEADING = Quantity("heading", longest_gap_s=1.0, angle=True)


def feed(
    track: Track, times_ms: Sequence[int], values: Sequence[float], statuses: Sequence[int] | None = None
) -> Track:
    status = np.array(statuses or [NORMAL] * len(values), np.uint8)
    track.append(np.array(times_ms, np.int64) * MS, np.array(values, float), status)
    return track


def at(track: Track, *times_ms: int) -> Values:
    return track.at(np.array(times_ms, np.int64) * MS)


def test_between_two_samples_the_value_is_linear() -> None:
    found = at(feed(Track(SPEED), [0, 500, 1000], [0, 10, 40]), 0, 250, 500, 600, 1000)
    assert found.value.tolist() == [0, 5, 10, 16, 40]
    assert found.status.tolist() == [NORMAL] * 5


@pytest.mark.parametrize(("first", "second", "middle"), [(170, -170, -180), (-170, 170, -180), (179, -177, -179)])
def test_angles_take_the_short_way_across_half_a_turn(first: float, second: float, middle: float) -> None:
    track = feed(Track(HEADING), [0, 100], [first, second])
    assert at(track, 50).value.tolist() == [middle]
    assert at(track, 100).value.tolist() == [second]
    beyond = second + (middle - second if abs(middle - second) < 180 else middle - second - 360) * -2
    assert at(track, 200).value.tolist() == [wrap(np.array([beyond])).item()]


def test_what_does_not_wrap_is_not_wrapped() -> None:
    assert at(feed(Track(SPEED), [0, 100], [170, -170]), 50).value.tolist() == [0]


def test_wrapped_angles_lie_from_minus_180_up_to_but_not_including_180() -> None:
    assert wrap(np.array([180.0, -180, 540, 359, -181, 0])).tolist() == [-180, -180, -180, -1, 179, 0]


def test_an_invalid_sample_is_a_hole_on_both_its_sides() -> None:
    track = feed(Track(SPEED), [0, 100, 200, 300, 400], [0, 1, 99, 3, 4], [0, 0, NO_COMPUTED_DATA, 0, 0])
    found = at(track, 50, 150, 250, 350)
    assert found.status.tolist() == [NORMAL, NO_COMPUTED_DATA, NO_COMPUTED_DATA, NORMAL]
    assert found.value.tolist() == [0.5, 0, 0, 3.5]


def test_nothing_is_extrapolated_from_an_invalid_sample() -> None:
    track = feed(Track(SPEED), [0, 100, 200], [0, 1, 2], [0, 0, NO_COMPUTED_DATA])
    assert at(track, 250).status.tolist() == [NO_COMPUTED_DATA]


def test_the_last_two_samples_are_extrapolated_for_the_longest_gap_and_then_stale() -> None:
    found = at(feed(Track(SPEED), [0, 500], [0, 10]), 1000, 1500, 1501)
    assert found.value.tolist() == [20, 30, 0]
    assert found.status.tolist() == [NORMAL, NORMAL, STALE]


def test_before_the_first_sample_the_same_bound_holds() -> None:
    assert at(feed(Track(SPEED), [5000, 5500], [0, 10]), 4000, 3999).status.tolist() == [NORMAL, STALE]


def test_nothing_is_interpolated_across_a_longer_silence_than_allowed() -> None:
    track = feed(Track(SPEED), [0, 1000, 2001, 3001], [0, 1, 2, 3])
    assert at(track, 500, 1500, 2500).status.tolist() == [NORMAL, STALE, NORMAL]


def test_a_status_of_the_bus_is_told_before_staleness() -> None:
    track = feed(Track(SPEED), [0, 100], [0, 1], [0, NO_COMPUTED_DATA])
    assert at(track, 9000).status.tolist() == [NO_COMPUTED_DATA]


def test_before_two_samples_everything_is_missing() -> None:
    track = Track(SPEED)
    assert track.newest is None
    assert at(track, 0).status.tolist() == [MISSING]
    feed(track, [0], [7])
    assert at(track, 0, 1).status.tolist() == [MISSING, MISSING]
    assert track.newest == (0, 7.0, NORMAL)


def test_of_two_samples_of_one_instant_the_later_stands() -> None:
    """No slope can be had from them: what lies beyond takes it from the sample before."""
    track = feed(Track(SPEED), [0, 100, 100], [0, 1, 2])
    assert at(track, 50, 150).value.tolist() == [0.5, 3]


def test_a_slope_is_never_taken_over_two_samples_that_came_close_together() -> None:
    """SPEED may be silent for 1 s, so 50 ms and more are fair: these lie 0.01 ms apart, and 1 unit."""
    times, values = np.array([0, 500_000, 500_010]) * 1000, np.array([0.0, 10, 11])
    track = Track(SPEED)
    track.append(times, values, np.zeros(3, np.uint8))
    assert at(track, 1000).value.tolist() == pytest.approx([22], abs=1e-3)
    before = Track(SPEED)
    before.append(-times[::-1], values[::-1], np.zeros(3, np.uint8))
    assert at(before, -1000).value.tolist() == pytest.approx([22], abs=1e-3)


@pytest.mark.parametrize(
    ("times_ms", "statuses"),
    [([100, 101], [0, 0]), ([0, 90, 100, 101], [0, NO_COMPUTED_DATA, 0, 0]), ([-5000, 100, 101], [0, 0, 0])],
)
def test_without_a_slope_the_value_holds(times_ms: list[int], statuses: list[int]) -> None:
    """There is nothing else, or only something across a hole or a silence."""
    track = feed(Track(SPEED), times_ms, [0.0] * (len(times_ms) - 2) + [5.0, 6.0], statuses)
    found = at(track, 600)
    assert (found.value.tolist(), found.status.tolist()) == ([6], [NORMAL])


@pytest.mark.parametrize("block", [1, 3, 7, 8, 50])
def test_a_full_buffer_keeps_the_newest_samples_whatever_the_blocks(block: int) -> None:
    track = Track(Quantity("speed", longest_gap_s=0.15), Samples.empty(1, capacity=8))
    times = np.arange(50) * 100
    for first in range(0, 50, block):
        feed(track, times[first : first + block].tolist(), (times[first : first + block] / 10).tolist())
    newest = np.arange(4250, 4900, 100)
    found = at(track, *newest.tolist())
    assert found.value.tolist() == (newest / 10).tolist()
    assert not found.status.any()
    assert track.newest == (4900 * MS, 490.0, NORMAL)
    assert at(track, 1000).status.tolist() == [STALE]


def test_a_clock_that_steps_back_forgets_what_was_measured_before() -> None:
    track = feed(Track(SPEED), [5000, 5100], [50, 51])
    feed(track, [1000], [10])
    assert at(track, 1000).status.tolist() == [MISSING]
    feed(track, [1100], [11])
    assert at(track, 1050, 5050).status.tolist() == [NORMAL, STALE]
    assert at(track, 1050).value.tolist() == [10.5]
