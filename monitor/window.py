"""Scans that follow each other, so that their shadows may be looked at together."""

from collections import deque
from itertools import islice
from typing import NamedTuple

from monitor.sample import ScanSample, together

LONGEST_NS = 120_000_000_000  # what was seen longer ago lies behind the aircraft


class _Kept(NamedTuple):
    time_ns: int
    setting: tuple[float, int]  # range and number of bins, without which disparities in bins cannot be compared
    sample: ScanSample


class Window:
    """The last scans, at most so many and of the last two minutes, the newest first.

    A scan of another range setting, and one from before those there are, as after a clock that began anew, is the first
    of a new row.
    """

    def __init__(self, scans: int) -> None:
        self._kept: deque[_Kept] = deque(maxlen=scans)

    def add(self, time_ns: int, setting: tuple[float, int], sample: ScanSample) -> None:
        """Take the newest scan."""
        if self._kept and (self._kept[0].setting != setting or time_ns < self._kept[0].time_ns):
            self._kept.clear()
        while self._kept and time_ns - self._kept[-1].time_ns > LONGEST_NS:
            self._kept.pop()
        self._kept.appendleft(_Kept(time_ns, setting, sample))

    def gather(self, scans: int, needed: int) -> tuple[ScanSample, int]:
        """The newest scan, with as many before it as it takes to have the needed pairs; and how many scans these are.

        Alone if not even so many scans have them.
        """
        pairs = 0
        for k, kept in enumerate(islice(self._kept, scans), 1):
            pairs += len(kept.sample.disparities)
            if pairs >= needed:
                return self.last(k), k
        return self.last(1), 1

    def last(self, scans: int) -> ScanSample:
        """The newest scans together, so many or all that there are."""
        return together([kept.sample for kept in islice(self._kept, scans)])
