"""The history of one measured quantity, and its value at any time between and shortly after its samples.

A sample that the bus marked as anything but normal is a hole: nothing is interpolated across it and nothing
extrapolated from it. The same goes for a silence longer than the quantity allows.

What lies beyond the samples follows their slope, and a slope over two words that came close together would be their
noise many times over: it is taken over a fair part of `longest_gap_s`, and where there is no such pair the value holds.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NORMAL, STALE, MISSING = 0, 254, 255  # bus statuses of ARINC 429 words lie between
NS = 1e-9
SHORTEST_SLOPE = 0.05  # of longest_gap_s, so that the noise of a sample grows 20 times at most


@dataclass(frozen=True)
class Quantity:
    """One quantity: its unit is in its name; `longest_gap_s` bounds interpolation and extrapolation.

    Angles wrap. A step holds its value until the next sample, as a mode or a flag does.
    """

    name: str
    longest_gap_s: float
    angle: bool = False
    step: bool = False


class Values(NamedTuple):
    """Values f8 (n,), 0 where `status` u1 (n,) is not NORMAL: a bus status, STALE or MISSING."""

    value: NDArray[np.float64]
    status: NDArray[np.uint8]


def wrap(angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same angles in [-180, 180)."""
    return (angle_deg + 180) % 360 - 180


class Track:
    """The last `capacity` samples of one quantity, in order of time."""

    def __init__(self, quantity: Quantity, capacity: int = 4096) -> None:
        self.quantity = quantity
        self._capacity = capacity
        self._time = np.empty(2 * capacity, np.int64)
        self._value = np.empty(2 * capacity)
        self._status = np.empty(2 * capacity, np.uint8)
        self._end = 0

    def append(self, time_ns: NDArray[np.int64], value: NDArray[np.float64], status: NDArray[np.uint8]) -> None:
        """Add samples (n,) in order of time; a clock that stepped back forgets what it had measured before."""
        if self._end and time_ns[0] < self._time[self._end - 1]:
            self._end = 0
        newest = slice(-self._capacity, None)
        time_ns, value, status = time_ns[newest], value[newest], status[newest]
        if self._end + len(time_ns) > 2 * self._capacity:
            for store in (self._time, self._value, self._status):
                store[: self._capacity] = store[self._end - self._capacity : self._end]
            self._end = self._capacity
        place = slice(self._end, self._end + len(time_ns))
        self._time[place], self._value[place], self._status[place] = time_ns, value, status
        self._end = place.stop

    def at(self, time_ns: NDArray[np.int64]) -> Values:
        """The quantity at times i8 (n,): linear between two normal samples, and shortly beyond the first and the last.

        A step is what its last sample before the time said.
        """
        if self.quantity.step:
            return self._held(time_ns)
        if self._end < 2:
            return Values(np.zeros(len(time_ns)), np.full(len(time_ns), MISSING, np.uint8))
        times, values, statuses = self._time[: self._end], self._value[: self._end], self._status[: self._end]
        after = np.clip(np.searchsorted(times, time_ns), 1, self._end - 1)
        before = after - 1
        span = times[after] - times[before]
        reach = np.maximum(span, np.maximum(time_ns - times[after], times[before] - time_ns))
        status = np.maximum(statuses[before], statuses[after])
        back, forth = self._lever(times[-1] - times[::-1], statuses[::-1]), self._lever(times - times[0], statuses)
        before = np.where(time_ns > times[-1], self._end - 1 - back, before)
        after = np.where(time_ns < times[0], forth, after)
        span = times[after] - times[before]
        status[(reach > round(self.quantity.longest_gap_s / NS)) & (status == NORMAL)] = STALE
        step = values[after] - values[before]
        if self.quantity.angle:
            step = wrap(step)
        # Without a slope the value holds; of two samples of one instant the later one stands.
        fraction = np.where(span > 0, (time_ns - times[before]) / np.maximum(span, 1), 1.0)
        value = values[before] + step * fraction
        if self.quantity.angle:
            value = wrap(value)
        return Values(np.where(status == NORMAL, value, 0.0), status)

    def _lever(self, distance_ns: NDArray[np.int64], status: NDArray[np.uint8]) -> int:
        """How many samples from the end of the track, nearest first, its slope is taken over; 0 if there is none."""
        longest = self.quantity.longest_gap_s / NS
        far = int(np.searchsorted(distance_ns, SHORTEST_SLOPE * longest))
        near_enough = far < len(distance_ns) and distance_ns[far] <= longest
        return far if near_enough and not status[: far + 1].any() else 0

    def _held(self, time_ns: NDArray[np.int64]) -> Values:
        if not self._end:
            return Values(np.zeros(len(time_ns)), np.full(len(time_ns), MISSING, np.uint8))
        times = self._time[: self._end]
        last = np.searchsorted(times, time_ns, side="right") - 1
        status = self._status[last]
        status[(time_ns - times[last] > round(self.quantity.longest_gap_s / NS)) & (status == NORMAL)] = STALE
        status[last < 0] = MISSING
        return Values(np.where(status == NORMAL, self._value[last], 0.0), status)

    @property
    def newest(self) -> tuple[int, float, int] | None:
        """Time in ns, value and status of the last sample, or None before the first."""
        if not self._end:
            return None
        return int(self._time[self._end - 1]), float(self._value[self._end - 1]), int(self._status[self._end - 1])
