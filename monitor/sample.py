"""What the tests of the monitor look at, of one scan."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Unmatched(NamedTuple):
    """Shadows of one thread that have no partner in the other, of those that could have one."""

    alone: int
    eligible: int

    @property
    def share(self) -> float | None:
        """From 0 to 1, or None without any eligible one."""
        return self.alone / self.eligible if self.eligible else None


class ScanSample(NamedTuple):
    """How far the front and back edges (N,) of the radar's shadows lie from those of their partners, range bins; the
    true azimuths (N,) of their radials and the sizes (N,) of their terrain shadows in range bins; the unmatched shadows
    of either thread, the signal level, and the mean height of the antenna above the ground below it, metres.
    """

    front: NDArray[np.float64]
    back: NDArray[np.float64]
    azimuth_rad: NDArray[np.float64]
    size: NDArray[np.float64]
    unmatched_radar: Unmatched
    unmatched_dem: Unmatched
    level: float  # of `signal_level`, NaN where nothing is lit
    height_m: float = math.nan

    @property
    def disparities(self) -> NDArray[np.float64]:
        """D of eq. (6), of the centres, range bins (N,)."""
        return (self.front + self.back) / 2


NONE = np.empty(0)
NOTHING = ScanSample(NONE, NONE, NONE, NONE, Unmatched(0, 0), Unmatched(0, 0), math.nan)


def signal_level(bins: NDArray[np.uint8]) -> float:
    """The mean level of what is lit in the farther half of the range bins (n, M); NaN where nothing is.

    Near ground fills a radar's highest level whatever its gain is; far ground shows a change of gain or of noise.
    """
    far = bins[:, bins.shape[1] // 2 :]
    lit = np.count_nonzero(far)
    return float(far.sum(dtype=np.int64) / lit) if lit else float("nan")
