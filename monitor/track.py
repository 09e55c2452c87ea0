"""The history of one measured quantity, and its value at any time between and shortly after its samples.

A sample that the bus marked as anything but normal is a hole: nothing is interpolated across it and nothing
extrapolated from it. The same goes for a silence longer than the quantity allows.

What lies beyond the samples follows their slope, and a slope over two words that came close together would be their
noise many times over: it is taken over a fair part of `longest_gap_s`, and where there is no such pair the value holds.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
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
        found = Values(np.zeros(len(time_ns)), np.empty(len(time_ns), np.uint8))
        samples = self._time[: self._end], self._value[: self._end], self._status[: self._end]
        longest_ns = round(self.quantity.longest_gap_s / NS)
        if self.quantity.step:
            _held(*samples, longest_ns, time_ns, *found)
        else:
            _between(*samples, longest_ns, self.quantity.angle, time_ns, *found)
        return found

    @property
    def newest(self) -> tuple[int, float, int] | None:
        """Time in ns, value and status of the last sample, or None before the first."""
        if not self._end:
            return None
        return int(self._time[self._end - 1]), float(self._value[self._end - 1]), int(self._status[self._end - 1])


@njit(cache=True)
def _held(times, values, statuses, longest_ns, time_ns, value, status):  # type: ignore[no-untyped-def] # typed by Track.at
    for i in range(time_ns.size):
        last = np.searchsorted(times, time_ns[i], side="right") - 1
        status[i] = MISSING if last < 0 else statuses[last]
        if status[i] == NORMAL and time_ns[i] - times[last] > longest_ns:
            status[i] = STALE
        if status[i] == NORMAL:
            value[i] = values[last]


@njit(cache=True)
def _between(times, values, statuses, longest_ns, angle, time_ns, value, status):  # type: ignore[no-untyped-def] # typed by Track.at
    if times.size < 2:
        status[:] = MISSING
        return
    end = times.size - 1
    back, forth = _lever_back(times, statuses, longest_ns), _lever_forth(times, statuses, longest_ns)
    for i in range(time_ns.size):
        now = time_ns[i]
        after = min(max(np.searchsorted(times, now), 1), end)
        before = after - 1
        reach = max(times[after] - times[before], now - times[after], times[before] - now)
        status[i] = max(statuses[before], statuses[after])
        if status[i] == NORMAL and reach > longest_ns:
            status[i] = STALE
        if status[i] != NORMAL:
            continue
        if now > times[end]:
            before = end - back
        elif now < times[0]:
            after = forth
        span = times[after] - times[before]
        step = values[after] - values[before]
        if angle:
            step = (step + 180) % 360 - 180
        # Without a slope the value holds; of two samples of one instant the later one stands.
        value[i] = values[before] + step * ((now - times[before]) / span if span > 0 else 1.0)
        if angle:
            value[i] = (value[i] + 180) % 360 - 180


@njit(cache=True)
def _lever_back(times, statuses, longest_ns):  # type: ignore[no-untyped-def] # typed by Track.at
    """How many samples from the last one its slope is taken over; 0 if there is none."""
    last = times.size - 1
    first = np.searchsorted(times, times[last] - np.int64(SHORTEST_SLOPE * longest_ns), side="right") - 1
    if first < 0 or times[last] - times[first] > longest_ns or statuses[first:].any():
        return 0
    return last - first


@njit(cache=True)
def _lever_forth(times, statuses, longest_ns):  # type: ignore[no-untyped-def] # typed by Track.at
    """How many samples from the first one its slope is taken over; 0 if there is none."""
    far = np.searchsorted(times, times[0] + np.int64(SHORTEST_SLOPE * longest_ns))
    if far == times.size or times[far] - times[0] > longest_ns or statuses[: far + 1].any():
        return 0
    return far
