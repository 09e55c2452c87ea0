"""Scans gathered until they have enough pairs of shadows for a verdict."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LONGEST_NS = 120_000_000_000  # what was seen longer ago lies behind the aircraft


class _Kept(NamedTuple):
    time_ns: int
    setting: tuple[float, int]  # range and number of bins, without which disparities in bins cannot be compared
    disparities: NDArray[np.float64]


class Window:
    """The last scans, at most so many."""

    def __init__(self, scans: int) -> None:
        self._kept: deque[_Kept] = deque(maxlen=scans)

    def gather(
        self, time_ns: int, setting: tuple[float, int], disparities: NDArray[np.float64], needed: int
    ) -> tuple[NDArray[np.float64], int]:
        """The disparities of the newest scan, with as many scans before it as it takes to have the needed pairs.

        And how many scans these are.

        A scan of another range setting, an older one than two minutes, or one from the future ends the row.
        """
        self._kept.appendleft(_Kept(time_ns, setting, disparities))
        chosen: list[NDArray[np.float64]] = []
        pairs = 0
        for kept in self._kept:
            if kept.setting != setting or not 0 <= time_ns - kept.time_ns <= LONGEST_NS:
                break
            chosen.append(kept.disparities)
            pairs += len(kept.disparities)
            if pairs >= needed:
                return np.concatenate(chosen), len(chosen)
        return disparities, 1
