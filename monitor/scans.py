"""Radials to scans: where one sweep of the antenna ends and the next begins.

A sweep ends where the scan angle turns back or jumps (one-directional radars jump from one end to the other), where
tilt, range or mode change, or after a silence. What is missing or repeated inside a sweep is counted from
the usual step.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoders.arinc708 import Radials
from monitor.track import wrap

JUMP_DEG = 30.0  # farther than any step between neighbours, nearer than any fly-back
SILENCE_NS = 2_000_000_000
LONGEST_SWEEP = 4096  # radials; a spinning antenna must still give scans
STUCK_NS = 2_000_000_000  # longer than any antenna rests where it turns back; a stuck one must be told in time


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

    @property
    def sector_deg(self) -> tuple[float, float]:
        """The smallest and the largest scan angle."""
        return float(self.scan_angle_deg.min()), float(self.scan_angle_deg.max())


class ScanBuilder:
    """Collects radials and gives a scan whenever a sweep has ended."""

    def __init__(self) -> None:
        self.number = 0
        self._rows: list[tuple[int, float, bool, NDArray[np.uint8]]] = []
        self._settings = (0.0, 0.0, 0, False, 0)  # tilt, range, mode, stabilised, bins
        self._faults = 0
        self._direction = 0.0
        self._moved_ns = 0  # when the scan angle last changed

    def feed(self, time_ns: NDArray[np.int64], radials: Radials) -> Iterator[Scan]:
        """Take radials (n,) in order of time; give the scans that they complete."""
        angles = np.asarray(radials.scan_angle_deg, float)
        limits = (radials.annunciations >> 4 & 1).astype(bool)  # header bit 17, the fifth annunciation
        for k in range(len(time_ns)):
            settings = (
                float(radials.tilt_deg[k]),
                float(radials.range_nm[k]),
                int(radials.mode[k]),
                bool(radials.stabilised[k]),
                radials.bins.shape[1],
            )
            if self._rows and (settings != self._settings or self._turns(int(time_ns[k]), angles[k])):
                yield self._close()
            if not self._rows or angles[k] != self._rows[-1][1]:
                self._moved_ns = int(time_ns[k])
            self._settings = settings
            self._faults |= int(radials.faults[k])
            self._rows.append((int(time_ns[k]), angles[k], bool(limits[k]), radials.bins[k]))

    def finish(self) -> Iterator[Scan]:
        """Give the sweep that is still open, if any."""
        if self._rows:
            yield self._close()

    def skip(self) -> int:
        """The number of a scan that never came: what is said of it must not pass for the scan before."""
        self.number += 1
        return self.number - 1

    def _turns(self, time_ns: int, angle_deg: float) -> bool:
        last_ns, last_deg = self._rows[-1][:2]
        step = (angle_deg - last_deg + 180) % 360 - 180
        turned = step * self._direction < 0
        if step and not turned:
            self._direction = step
        silent = not 0 <= time_ns - last_ns <= SILENCE_NS
        stuck = not step and time_ns - self._moved_ns > STUCK_NS
        return turned or abs(step) > JUMP_DEG or silent or stuck or len(self._rows) >= LONGEST_SWEEP

    def _close(self) -> Scan:
        tilt, range_nm, mode, stabilised, _ = self._settings
        times, angles, limits, bins = zip(*self._rows, strict=True)
        steps = np.abs(wrap(np.diff(np.array(angles))))
        moving = steps[steps > 0]
        missing = int(np.sum(np.maximum(np.round(moving / np.median(moving)) - 1, 0))) if moving.size else 0
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
            missing,
            int(np.sum(steps == 0)),
        )
        self.number += 1
        self._rows = []
        self._direction = 0.0
        self._faults = 0
        return scan
