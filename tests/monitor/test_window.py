"""Scans gathered until they have enough pairs."""

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor.sample import signal_level
from monitor.window import Window

SECOND_NS = 1_000_000_000
NEEDED = 16
SETTING = (10.0, 512)


def scan(pairs: int, mark: float) -> NDArray[np.float64]:
    """The disparities of a scan."""
    return np.full(pairs, mark)


def fed(window: Window, *scans: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """What the last of scans, four seconds apart, comes to."""
    found = [window.gather(4 * k * SECOND_NS, SETTING, one, NEEDED) for k, one in enumerate(scans)]
    return found[-1]


def test_a_scan_with_enough_pairs_stands_alone() -> None:
    found, scans = fed(Window(5), scan(20, 1.0), scan(16, 2.0))
    assert (found.tolist(), scans) == ([2.0] * 16, 1)


def test_as_many_scans_before_it_are_taken_as_it_needs() -> None:
    found, scans = fed(Window(5), scan(9, 1.0), scan(6, 2.0), scan(6, 3.0), scan(6, 4.0))
    assert (found.tolist(), scans) == ([4.0] * 6 + [3.0] * 6 + [2.0] * 6, 3)


def test_without_enough_in_all_of_them_the_scan_stands_alone() -> None:
    found, scans = fed(Window(2), scan(9, 1.0), scan(6, 2.0), scan(6, 3.0))
    assert (len(found), scans) == (6, 1)


@pytest.mark.parametrize(
    ("time_s", "setting"),
    [(121, SETTING), (-1, SETTING), (4, (20.0, 512)), (4, (10.0, 256))],
    ids=["two minutes later", "after the clock began anew", "at another range", "of another number of bins"],
)
def test_scans_that_do_not_belong_together_are_not_gathered(time_s: int, setting: tuple[float, int]) -> None:
    window = Window(5)
    window.gather(0, SETTING, scan(10, 1.0), NEEDED)
    assert window.gather(time_s * SECOND_NS, setting, scan(10, 2.0), NEEDED)[1] == 1


def test_the_signal_level_is_the_mean_of_what_is_lit_in_the_farther_half() -> None:
    bins = np.array([[3, 3, 3, 3, 0, 1, 2, 0], [1, 1, 1, 1, 0, 0, 4, 0]], np.uint8)
    assert signal_level(bins) == (1 + 2 + 4) / 3
    assert np.isnan(signal_level(np.zeros((2, 8), np.uint8)))
