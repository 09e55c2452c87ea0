"""Radials to scans: where one sweep of the antenna ends and the next begins.

A sweep ends where the scan angle turns back or jumps (one-directional radars jump from one end to the other), where
tilt, range or mode change, or after a silence. What is missing or repeated inside a sweep is counted from the usual
step, and what is missing at its ends from the sweep before. An angle that trembles by one code neither turns nor moves.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from decoders.arinc708 import Radials
from decoders.formats import HEADER_708, SCAN_ANGLE_LSB_DEG
from monitor.track import wrap

Int = Any  # of whatever width the loop has

JITTER_DEG = 1.5 * SCAN_ANGLE_LSB_DEG  # more than one code and less than two
TREMBLE_DEG = 0.25 * SCAN_ANGLE_LSB_DEG  # so that three codes for two are a tremble, and four a missing radial
JUMP_DEG = 30.0  # farther than any step between neighbours, nearer than any fly-back
SILENCE_NS = 2_000_000_000
LONGEST_SWEEP = 4096  # radials; a spinning antenna must still give scans
STUCK_NS = 2_000_000_000  # longer than any antenna rests where it turns back; a stuck one must be told in time

ANGLE_BIT, ANGLE_BITS = HEADER_708["scan_angle"]
ANGLE_MASK, HALF_TURN = (1 << ANGLE_BITS) - 1, 1 << ANGLE_BITS - 1
SETTINGS = ("stabilised", "mode", "tilt", "range")
SETTINGS_MASK = sum((1 << HEADER_708[name][1]) - 1 << HEADER_708[name][0] for name in SETTINGS)
MOVES_CODES = math.ceil(JITTER_DEG / SCAN_ANGLE_LSB_DEG)
JUMP_CODES = math.floor(JUMP_DEG / SCAN_ANGLE_LSB_DEG)
BEYOND_LIMITS = 4  # of the annunciations: header bit 17

SWEEP = np.dtype(  # the open sweep, all zero before its first radial
    [
        ("radials", "i8"),
        ("last_ns", "i8"),  # of its last radial
        ("last_deg", "f8"),
        ("direction", "f8"),  # 1 or -1 once it is known
        ("farthest_deg", "f8"),  # in the direction of the sweep
        ("rest_deg", "f8"),  # where the antenna was when it last moved
        ("moved_ns", "i8"),  # and when
        ("at_rest", "i8"),  # radials since then
        ("tilt_deg", "f8"),
        ("range_nm", "f8"),
        ("mode", "i8"),
        ("stabilised", "?"),
        ("bins", "i8"),
        ("faults", "i8"),
    ]
)


@dataclass(frozen=True)
class Scan:
    """One sweep: arrays (n,) in order of arrival, `bins` (n, M), one tilt, range and mode."""

    number: int
    time_ns: NDArray[np.int64]
    scan_angle_deg: NDArray[np.float64]
    beyond_limits: NDArray[np.bool_]
    bins: NDArray[np.uint8]
    tilt_deg: float
    range_nm: float
    mode: int
    stabilised: bool
    faults: int  # header bits 18 to 24 of all its radials together, bit 18 the least significant
    missing: int
    repeated: int
    cut_off: int = 0  # radials that the whole sweep before had at the ends, and this whole sweep has not
    profile: str = ""  # by whose name its words were read, if that is known

    @property
    def sector_deg(self) -> tuple[float, float]:
        """The ends of the sweep; across the tail one of them lies beyond 180 degrees, as in (170, 190)."""
        return _sector(self.scan_angle_deg)


class SweepWatch:
    """Tells radials that certainly go on with their sweep from those that may end it, by their header bits alone.

    Certain is the same tilt, range, mode and stabilisation, and a step nearer than any jump: one farther than any
    tremble in the direction of the step before, any at all after a jump, which has begun a sweep, or one tremble after
    a step so large that the antenna has surely moved. Whoever must know at once when a sweep ends need not look at
    such ones.
    """

    def __init__(self) -> None:
        self.last = np.zeros(4, np.int64)  # of the radial before: settings, angle code, step to it in codes or 0, time

    def goes_on(self, time_ns: int, header: int) -> bool:
        """Whether a radial goes on, by its first 64 bits as a signed integer, bit 0 the least significant."""
        certain = bool(goes_on(self.last, time_ns, header))
        follow(self.last, time_ns, header)
        return certain


@njit(cache=True)
def goes_on(last: NDArray[np.int64], time_ns: Int, header: Int) -> bool:
    """Whether a radial certainly goes on with the sweep of the one before."""
    settings, code, before, before_ns = last
    step = _step_codes(code, header)
    same = header & SETTINGS_MASK == settings and 0 < time_ns - before_ns <= SILENCE_NS // 2  # whatever its clock
    moves = abs(step) >= MOVES_CODES and (step * before > 0 or abs(before) > JUMP_CODES)
    rests = abs(step) < MOVES_CODES < abs(before)
    return bool(same and abs(step) <= JUMP_CODES and (moves or rests))


@njit(cache=True)
def follow(last: NDArray[np.int64], time_ns: Int, header: Int) -> None:
    """Make a radial the one before."""
    step = _step_codes(last[1], header)
    last[0], last[1], last[3] = header & SETTINGS_MASK, header >> ANGLE_BIT & ANGLE_MASK, time_ns
    last[2] = 0 if abs(step) < MOVES_CODES else step


@njit(cache=True)
def _step_codes(code: Int, header: Int) -> Int:
    return ((header >> ANGLE_BIT & ANGLE_MASK) - code + HALF_TURN & ANGLE_MASK) - HALF_TURN


class ScanBuilder:
    """Collects radials and gives a scan whenever a sweep has ended."""

    def __init__(self) -> None:
        self.number = 0
        self._sweep = np.zeros(1, SWEEP)
        self._blocks: list[tuple[NDArray[Any], ...]] = []  # of its radials: time, scan angle, annunciations, bins
        self._profile = ""  # of its newest radials
        self._began_whole = False
        self._before: Scan | None = None  # the last sweep that was whole, if it is the one before

    def feed(self, time_ns: NDArray[np.int64], radials: Radials, profile: str = "") -> Iterator[Scan]:
        """Take radials (n,) in order of time, read by a profile of that name; give the scans that they complete."""
        columns = (time_ns, radials.scan_angle_deg, radials.annunciations, radials.bins)
        begin = 0
        while begin < len(time_ns):
            end, whole = _add(self._sweep, begin, time_ns, radials)
            if end > begin:
                self._blocks.append(tuple(column[begin:end] for column in columns))
                self._profile = profile
            if end < len(time_ns):
                yield self._close(whole)
            begin = end

    def finish(self) -> Iterator[Scan]:
        """Give the sweep that is still open, if any."""
        if self._blocks:
            yield self._close(whole=False)

    def skip(self) -> int:
        """The number of a scan that never came: what is said of it must not pass for the scan before."""
        self.number += 1
        return self.number - 1

    def _close(self, whole: bool) -> Scan:
        sweep = self._sweep[0]
        times, angles, annunciations, bins = (np.concatenate(blocks) for blocks in zip(*self._blocks, strict=True))
        steps = np.abs(wrap(np.diff(angles)))
        moving = steps[steps > 0]
        usual = _usual(moving)
        rested = sweep["at_rest"] if times[-1] - sweep["moved_ns"] > STUCK_NS // 2 else 0  # trembling all the while
        scan = Scan(
            self.number,
            times,
            angles,
            (annunciations >> BEYOND_LIMITS & 1).astype(bool),
            bins,
            float(sweep["tilt_deg"]),
            float(sweep["range_nm"]),
            int(sweep["mode"]),
            bool(sweep["stabilised"]),
            int(sweep["faults"]),
            missing=int(np.sum(np.maximum(np.round((moving - TREMBLE_DEG) / usual) - 1, 0))) if usual else 0,
            repeated=int(max(len(steps) - len(moving), rested)),
            profile=self._profile,
        )
        if whole and self._began_whole:
            if self._before and usual:
                scan = replace(scan, cut_off=_cut_off(self._before, scan, usual))
            self._before = scan
        elif not whole:
            self._before = None
        self.number += 1
        self._sweep[:], self._blocks = 0, []
        self._began_whole = whole
        return scan


@njit(cache=True)
def _add(sweep: Any, first: int, time_ns: NDArray[np.int64], radials: Radials) -> tuple[int, bool]:
    """Add radials from `first` on to a sweep until one begins the next: its index or n, and if the sweep is whole."""
    s, bins = sweep[0], radials.bins.shape[1]
    angles, tilts, ranges = radials.scan_angle_deg, radials.tilt_deg, radials.range_nm
    modes, stabilised, faults = radials.mode, radials.stabilised, radials.faults
    for k in range(first, time_ns.size):
        time, angle = time_ns[k], angles[k]
        if s.radials:
            turned, broken = _turns(s, angle), _breaks(s, time, angle)
            same = s.tilt_deg == tilts[k] and s.range_nm == ranges[k] and s.mode == modes[k]
            same = same and s.stabilised == stabilised[k] and s.bins == bins
            if turned or broken or not same:
                return k, turned and not broken
        s.tilt_deg, s.range_nm, s.mode, s.stabilised, s.bins = tilts[k], ranges[k], modes[k], stabilised[k], bins
        s.faults |= faults[k]
        _follow(s, time, angle)
    return time_ns.size, False


@njit(cache=True)
def _breaks(s: Any, time_ns: Int, angle_deg: float) -> bool:
    silent = not 0 <= time_ns - s.last_ns <= SILENCE_NS
    stuck = abs(_step(s.rest_deg, angle_deg)) <= JITTER_DEG and time_ns - s.moved_ns > STUCK_NS
    return silent or stuck or s.radials >= LONGEST_SWEEP


@njit(cache=True)
def _turns(s: Any, angle_deg: float) -> bool:
    back = -_step(s.farthest_deg, angle_deg) * s.direction
    return back > JITTER_DEG or abs(_step(s.last_deg, angle_deg)) > JUMP_DEG


@njit(cache=True)
def _follow(s: Any, time_ns: Int, angle_deg: float) -> None:
    """Keep how far the antenna has come, and since when it rests."""
    if not s.radials:
        s.farthest_deg = angle_deg
    step = _step(s.farthest_deg, angle_deg)
    if not s.direction and abs(step) > JITTER_DEG:
        s.direction = np.sign(step)
    if step * s.direction > 0:
        s.farthest_deg = angle_deg
    if not s.radials or abs(_step(s.rest_deg, angle_deg)) > JITTER_DEG:
        s.rest_deg, s.moved_ns, s.at_rest = angle_deg, time_ns, 0
    else:
        s.at_rest += 1
    s.radials += 1
    s.last_ns, s.last_deg = time_ns, angle_deg


def _usual(steps_deg: NDArray[np.float64]) -> float:
    """The radar's own step, which whole codes round up and down: the mean of those nearest to the median."""
    if not steps_deg.size:
        return 0.0
    lower, upper = np.sort(steps_deg)[[(steps_deg.size - 1) // 2, steps_deg.size // 2]]
    near = np.abs(steps_deg - (lower + upper) / 2) < JITTER_DEG
    if not near.any():  # the median lies between two far apart, and missing radials only lengthen a step
        near = np.abs(steps_deg - lower) < JITTER_DEG
    return float(steps_deg[near].mean())


def _cut_off(before: Scan, scan: Scan, step_deg: float) -> int:
    """How many steps the ends of `before` lie beyond those of `scan`.

    A to-and-fro sweep begins one step from where the one before ended, and an antenna does not turn at the same step
    each time: one step more or less is no loss.
    """
    (low, high), (low_before, high_before) = scan.sector_deg, before.sector_deg
    turn = round((low + high - low_before - high_before) / 720) * 360  # of sectors across the tail
    lost = {low: low - turn - low_before, high: high_before + turn - high}
    begin = float(scan.scan_angle_deg[0])
    if abs(_step(float(before.scan_angle_deg[-1]), begin)) <= JUMP_DEG:
        lost[min(lost, key=lambda end: abs(_step(end, begin)))] -= step_deg
    return sum(steps for steps in (round(degrees / step_deg) for degrees in lost.values()) if steps > 1)


@njit(cache=True)
def _sector(angle_deg: NDArray[np.float64]) -> tuple[float, float]:
    at = low = high = angle_deg[0]
    for k in range(1, angle_deg.size):
        at += _step(angle_deg[k - 1], angle_deg[k])
        low, high = min(low, at), max(high, at)
    return low, high


@njit(cache=True)
def _step(from_deg: float, to_deg: float) -> float:
    step = to_deg - from_deg
    return step - 360 * math.floor((step + 180) / 360)  # the remainder itself takes ten times as long
