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

    @property
    def sector_deg(self) -> tuple[float, float]:
        """The ends of the sweep; across the tail one of them lies beyond 180 degrees, as in (170, 190)."""
        angles = np.unwrap(self.scan_angle_deg, period=360)
        return float(angles.min()), float(angles.max())


class SweepWatch:
    """Tells radials that certainly go on with their sweep from those that may end it, by their header bits alone.

    Certain is the same tilt, range, mode and stabilisation, and a step in the direction of the step before, farther
    than any tremble and nearer than any jump. Whoever must know at once when a sweep ends need not look at such ones.
    """

    def __init__(self) -> None:
        self.last = np.zeros(4, np.int64)  # of the radial before: settings, angle code, direction, time

    def goes_on(self, time_ns: int, header: int) -> bool:
        """Whether a radial goes on, by its first 64 bits as a signed integer, bit 0 the least significant."""
        certain = bool(goes_on(self.last, time_ns, header))
        follow(self.last, time_ns, header)
        return certain


@njit(cache=True)
def goes_on(last: NDArray[np.int64], time_ns: Int, header: Int) -> bool:
    """Whether a radial certainly goes on with the sweep of the one before."""
    settings, code, direction, before_ns = last
    step = _step_codes(code, header)
    same = header & SETTINGS_MASK == settings and 0 < time_ns - before_ns <= SILENCE_NS // 2  # whatever its clock
    return bool(same and MOVES_CODES <= step * direction <= JUMP_CODES)


@njit(cache=True)
def follow(last: NDArray[np.int64], time_ns: Int, header: Int) -> None:
    """Make a radial the one before."""
    step = _step_codes(last[1], header)
    last[0], last[1], last[3] = header & SETTINGS_MASK, header >> ANGLE_BIT & ANGLE_MASK, time_ns
    last[2] = 0 if abs(step) < MOVES_CODES else 1 if step > 0 else -1


@njit(cache=True)
def _step_codes(code: Int, header: Int) -> Int:
    return ((header >> ANGLE_BIT & ANGLE_MASK) - code + HALF_TURN & ANGLE_MASK) - HALF_TURN


class ScanBuilder:
    """Collects radials and gives a scan whenever a sweep has ended."""

    def __init__(self) -> None:
        self.number = 0
        self._rows: list[tuple[int, float, bool, NDArray[np.uint8]]] = []
        self._settings = (0.0, 0.0, 0, False, 0)  # tilt, range, mode, stabilised, bins
        self._faults = 0
        self._direction = 0.0
        self._farthest_deg = 0.0  # in the direction of the sweep
        self._rest_deg = 0.0  # where the antenna was when it last moved
        self._moved_ns = 0  # and when
        self._at_rest = 0  # radials since then
        self._began_whole = False
        self._before: Scan | None = None  # the last sweep that was whole, if it is the one before

    def feed(self, time_ns: NDArray[np.int64], radials: Radials) -> Iterator[Scan]:
        """Take radials (n,) in order of time; give the scans that they complete."""
        limits = (radials.annunciations >> 4 & 1).astype(bool)  # header bit 17, the fifth annunciation
        columns = (radials.tilt_deg, radials.range_nm, radials.mode, radials.stabilised)
        settings = list(
            zip(*(column.tolist() for column in columns), [radials.bins.shape[1]] * len(time_ns), strict=True)
        )
        rows = list(zip(time_ns.tolist(), radials.scan_angle_deg.tolist(), limits.tolist(), radials.bins, strict=True))
        onward = _onward(time_ns, radials)
        k = 0
        while k < len(rows):
            time, angle, _, _ = rows[k]
            if self._rows:
                turned, broken = self._turns(angle), self._breaks(time, angle)
                if turned or broken or settings[k] != self._settings:
                    yield self._close(whole=turned and not broken)
            self._settings = settings[k]
            self._follow(time, angle)
            end = k + 1
            if self._direction and self._farthest_deg == angle == self._rest_deg:
                end += int(np.argmax(np.r_[onward[end:] != self._direction, True]))  # those that only go on
                end = min(end, k + LONGEST_SWEEP - len(self._rows))
            if end > k + 1:
                self._farthest_deg = self._rest_deg = rows[end - 1][1]
                self._moved_ns, self._at_rest = rows[end - 1][0], 0
            self._faults |= int(np.bitwise_or.reduce(radials.faults[k:end]))
            self._rows += rows[k:end]
            k = end

    def finish(self) -> Iterator[Scan]:
        """Give the sweep that is still open, if any."""
        if self._rows:
            yield self._close(whole=False)

    def skip(self) -> int:
        """The number of a scan that never came: what is said of it must not pass for the scan before."""
        self.number += 1
        return self.number - 1

    def _breaks(self, time_ns: int, angle_deg: float) -> bool:
        silent = not 0 <= time_ns - self._rows[-1][0] <= SILENCE_NS
        stuck = abs(_step(self._rest_deg, angle_deg)) <= JITTER_DEG and time_ns - self._moved_ns > STUCK_NS
        return silent or stuck or len(self._rows) >= LONGEST_SWEEP

    def _turns(self, angle_deg: float) -> bool:
        back = -_step(self._farthest_deg, angle_deg) * self._direction
        return back > JITTER_DEG or abs(_step(self._rows[-1][1], angle_deg)) > JUMP_DEG

    def _follow(self, time_ns: int, angle_deg: float) -> None:
        """Keep how far the antenna has come, and since when it rests."""
        if not self._rows:
            self._direction = 0.0
            self._farthest_deg = angle_deg
        step = _step(self._farthest_deg, angle_deg)
        if not self._direction and abs(step) > JITTER_DEG:
            self._direction = float(np.sign(step))
        if step * self._direction > 0:
            self._farthest_deg = angle_deg
        if not self._rows or abs(_step(self._rest_deg, angle_deg)) > JITTER_DEG:
            self._rest_deg, self._moved_ns, self._at_rest = angle_deg, time_ns, 0
        else:
            self._at_rest += 1

    def _close(self, whole: bool) -> Scan:
        tilt, range_nm, mode, stabilised, _ = self._settings
        times, angles, limits, bins = zip(*self._rows, strict=True)
        steps = np.abs(wrap(np.diff(np.array(angles))))
        moving = steps[steps > 0]
        usual = _usual(moving)
        rested = self._at_rest if times[-1] - self._moved_ns > STUCK_NS // 2 else 0  # trembling all the while
        scan = Scan(
            self.number,
            np.array(times, np.int64),
            np.array(angles),
            np.array(limits),
            np.array(bins),
            tilt,
            range_nm,
            mode,
            stabilised,
            self._faults,
            missing=int(np.sum(np.maximum(np.round((moving - TREMBLE_DEG) / usual) - 1, 0))) if usual else 0,
            repeated=max(int(np.sum(steps == 0)), rested),
        )
        if whole and self._began_whole:
            if self._before and usual:
                scan = replace(scan, cut_off=_cut_off(self._before, scan, usual))
            self._before = scan
        elif not whole:
            self._before = None
        self.number += 1
        self._rows = []
        self._faults = 0
        self._began_whole = whole
        return scan


def _onward(time_ns: NDArray[np.int64], radials: Radials) -> NDArray[np.float64]:
    """Of radials (n,): the sign of a step from the one before that ends no sweep if it goes the sweep's way, else 0."""
    steps = wrap(np.diff(radials.scan_angle_deg))
    waited_ns = np.diff(time_ns)
    plain = (np.abs(steps) > JITTER_DEG) & (np.abs(steps) <= JUMP_DEG) & (waited_ns >= 0) & (waited_ns <= SILENCE_NS)
    for column in (radials.tilt_deg, radials.range_nm, radials.mode, radials.stabilised):
        plain &= column[1:] == column[:-1]
    return np.concatenate([[0.0], np.where(plain, np.sign(steps), 0.0)])


def _usual(steps_deg: NDArray[np.float64]) -> float:
    """The radar's own step, which whole codes round up and down: the mean of those nearest to the median."""
    if not steps_deg.size:
        return 0.0
    return float(steps_deg[np.abs(steps_deg - np.median(steps_deg)) < JITTER_DEG].mean())


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


def _step(from_deg: float, to_deg: float) -> float:
    return (to_deg - from_deg + 180) % 360 - 180
