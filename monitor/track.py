"""The history of one measured quantity, and its value at any time between and shortly after its samples.

A sample that the bus marked as anything but normal is a hole: nothing is interpolated across it and nothing
extrapolated from it. The same goes for a silence longer than the quantity allows.

What lies beyond the samples follows their slope, and a slope over two words that came close together would be their
noise many times over: it is taken over a fair part of `longest_gap_s`, and where there is no such pair the value holds.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

NORMAL, STALE, MISSING = 0, 254, 255  # bus statuses of ARINC 429 words lie between
NS = 1e-9
CAPACITY = 4096  # samples of a quantity
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


class Samples(NamedTuple):
    """The samples of m quantities in order of time, each a row, of which the first `end` are filled."""

    time_ns: NDArray[np.int64]  # (m, room)
    value: NDArray[np.float64]
    status: NDArray[np.uint8]
    end: NDArray[np.int64]  # (m,)

    @classmethod
    def empty(cls, m: int, capacity: int = CAPACITY) -> Self:
        """Room for the last `capacity` samples of each quantity, at least."""
        room = m, 2 * capacity
        return cls(np.empty(room, np.int64), np.empty(room), np.empty(room, np.uint8), np.zeros(m, np.int64))


class Track:
    """The last samples of one quantity: its row of `samples`, or samples of its own."""

    def __init__(self, quantity: Quantity, samples: Samples | None = None, row: int = 0) -> None:
        self.quantity = quantity
        self._samples = samples or Samples.empty(1)
        self._row = row

    def append(self, time_ns: NDArray[np.int64], value: NDArray[np.float64], status: NDArray[np.uint8]) -> None:
        """Add samples (n,) in order of time; a clock that stepped back forgets what it had measured before."""
        for k in range(len(time_ns)):
            put(self._samples, self._row, time_ns[k], value[k], status[k])

    def at(self, time_ns: NDArray[np.int64]) -> Values:
        """The quantity at times i8 (n,): linear between two normal samples, and shortly beyond the first and the last.

        A step is what its last sample before the time said.
        """
        found = Values(np.zeros(len(time_ns)), np.empty(len(time_ns), np.uint8))
        filled = self._row, slice(self._samples.end[self._row])
        times, values, statuses = (column[filled] for column in self._samples[:3])
        longest_ns = round(self.quantity.longest_gap_s / NS)
        if self.quantity.step:
            _held(times, values, statuses, longest_ns, time_ns, *found)
        else:
            _between(times, values, statuses, longest_ns, self.quantity.angle, time_ns, *found)
        return found

    @property
    def newest(self) -> tuple[int, float, int] | None:
        """Time in ns, value and status of the last sample, or None before the first."""
        times, values, statuses, ends = self._samples
        last = self._row, int(ends[self._row]) - 1
        return (int(times[last]), float(values[last]), int(statuses[last])) if last[1] >= 0 else None


@njit(cache=True)
def put(samples, row, time_ns, value, status):  # type: ignore[no-untyped-def] # typed by Samples
    """Add a sample; a clock that stepped back forgets what it had measured before, and the oldest half makes room."""
    times, values, statuses, ends = samples
    end, room = ends[row], times.shape[1]
    if end and time_ns < times[row, end - 1]:
        end = 0
    if end == room:
        end = room // 2
        for k in range(end):  # slices would take seconds to compile, for the words of their errors
            times[row, k], values[row, k] = times[row, end + k], values[row, end + k]
            statuses[row, k] = statuses[row, end + k]
    times[row, end], values[row, end], statuses[row, end] = time_ns, value, status
    ends[row] = end + 1


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
