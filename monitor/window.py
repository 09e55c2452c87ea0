"""Scans gathered until they have enough pairs of shadows for a verdict."""

from collections import deque
from typing import NamedTuple

from monitor.sample import ScanSample, together

LONGEST_NS = 120_000_000_000  # what was seen longer ago lies behind the aircraft


class _Kept(NamedTuple):
    time_ns: int
    setting: tuple[float, int]  # range and number of bins, without which disparities in bins cannot be compared
    sample: ScanSample


class Window:
    """The last scans, at most so many."""

    def __init__(self, scans: int) -> None:
        self._kept: deque[_Kept] = deque(maxlen=scans)

    def gather(
        self, time_ns: int, setting: tuple[float, int], sample: ScanSample, needed: int
    ) -> tuple[ScanSample, int]:
        """The newest scan, with as many before it as it takes to have the needed pairs; and how many scans these are.

        A scan of another range setting, an older one than two minutes, or one from the future ends the row.
        """
        self._kept.appendleft(_Kept(time_ns, setting, sample))
        chosen: list[ScanSample] = []
        pairs = 0
        for kept in self._kept:
            if kept.setting != setting or not 0 <= time_ns - kept.time_ns <= LONGEST_NS:
                break
            chosen.append(kept.sample)
            pairs += len(kept.sample.disparities)
            if pairs >= needed:
                return together(chosen), len(chosen)
        return sample, 1
