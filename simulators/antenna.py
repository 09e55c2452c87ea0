"""Antenna scan profiles: which way the boresight looks, and when."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulators import scenario

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SECTOR_DEG = 180.0


@dataclass(frozen=True)
class Profile:
    """A scan from -90 to +90 degrees at a constant rate; `to_and_fro` scans back, the other kind jumps back."""

    rate_deg_s: float
    step_deg: float
    to_and_fro: bool


PROFILES = {
    "wxr2100": Profile(rate_deg_s=40.0, step_deg=0.5, to_and_fro=False),  # 80 radials a second
    "rdr4b": Profile(rate_deg_s=95.0, step_deg=0.5, to_and_fro=True),  # 190 radials a second
}


@dataclass(frozen=True)
class Scan:
    """The antenna's timetable: radial k is taken at k * interval_s."""

    interval_s: float
    step_deg: float
    positions: int
    to_and_fro: bool

    def angles_deg(self, radials: Integers) -> Floats:
        """Scan angles (n,) in degrees, clockwise from the nose, of radials (n,) counted from the start."""
        if self.to_and_fro:
            turn = self.positions - 1
            position = turn - np.abs(radials % (2 * turn) - turn)
        else:
            position = radials % self.positions
        return np.asarray(-SECTOR_DEG / 2 + self.step_deg * position, np.float64)

    def radials_between(self, start_s: float, stop_s: float) -> Integers:
        """Numbers of the radials taken in [start, stop)."""
        first, end = (int(np.ceil(round(time / self.interval_s, 6))) for time in (start_s, stop_s))
        return np.arange(first, end, dtype=np.int64)


def scan(settings: scenario.Radar) -> Scan:
    """The timetable of the settings: a wider step means fewer radials a second at the same rate in degrees a second."""
    profile = PROFILES[settings.antenna]
    step = settings.step_deg or profile.step_deg
    return Scan(step / profile.rate_deg_s, step, int(SECTOR_DEG / step + 1e-9) + 1, profile.to_and_fro)
