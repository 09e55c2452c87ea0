"""One time for all bridges: the device clock of the first bridge that spoke.

Words of one bridge keep their own device times exactly. Another bridge's clock is laid beside it through the host's
monotonic clock: the smallest delay from stamp to reading seen so far stands for the true offset, since delays only ever
add, and is let up slowly so that drifting clocks are followed.
"""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

DRIFT_PER_S = 1e-4  # what two quartz clocks may drift apart
RESTART_NS = 1_000_000_000  # a device time that steps back this far is a clock that began anew
LEAP_NS = 60_000_000_000  # and so is one that runs ahead of the host's clock this far between two packets

Int = int | np.int64
CLOCK: Final = np.dtype(
    [("seen", "?"), ("offset_ns", "f8"), ("host_ns", "i8"), ("device_ns", "i8")]  # host minus device, and both times
)


class Timebase:
    """Maps device times to the common time. `restarts` counts clocks that began anew."""

    def __init__(self, adapters: list[str]) -> None:
        self.restarts = 0
        self.clocks = np.zeros(len(adapters), CLOCK)  # as they were when last seen
        self.reference = np.full(1, -1)  # which of them is the common one
        self._numbers = {name: number for number, name in enumerate(adapters)}

    def offset_ns(self, adapter: str, device_ns: int, host_ns: int) -> int:
        """What to add to this adapter's device times, given one just read at `host_ns`."""
        offset_ns, anew = follow(self.clocks, self.reference, self._numbers[adapter], device_ns, host_ns)
        self.restarts += anew
        return int(offset_ns)

    @property
    def heard(self) -> bool:
        """Whether there is a common time yet."""
        return bool(self.reference[0] >= 0)

    def host_offset_ns(self, adapter: str | None = None) -> int:
        """What to add to device times of an adapter, or to common times, for the host's monotonic clock."""
        number = self._numbers[adapter] if adapter else int(self.reference[0])
        return round(float(self.clocks[number]["offset_ns"]))


@njit(cache=True)
def begins_anew(clocks: NDArray[Any], number: Int, device_ns: Int, host_ns: Int) -> bool:
    """Whether the next packet of a clock shows that it began anew."""
    clock = clocks[number]
    elapsed_ns = device_ns - clock.device_ns
    return bool(clock.seen and (elapsed_ns < -RESTART_NS or elapsed_ns - (host_ns - clock.host_ns) > LEAP_NS))


@njit(cache=True)
def follow(
    clocks: NDArray[Any], reference: NDArray[np.int64], number: Int, device_ns: Int, host_ns: Int
) -> tuple[float, bool]:
    """Take the next packet of a clock: what leads from its times to those of the reference, and if it began anew."""
    if reference[0] < 0:
        reference[0] = number
    clock, anew = clocks[number], begins_anew(clocks, number, device_ns, host_ns)
    seen_ns = float(host_ns - device_ns)
    if clock.seen and not anew:
        seen_ns = min(seen_ns, clock.offset_ns + (host_ns - clock.host_ns) * DRIFT_PER_S)
    clock.seen, clock.offset_ns, clock.host_ns, clock.device_ns = True, seen_ns, host_ns, device_ns
    return np.rint(seen_ns - clocks[reference[0]].offset_ns), anew
