"""One time for all bridges: the device clock of the first bridge that spoke.

Words of one bridge keep their own device times exactly. Another bridge's clock is laid beside it through the host's
monotonic clock: the smallest delay from stamp to reading seen so far stands for the true offset, since delays only ever
add, and is let up slowly so that drifting clocks are followed.
"""

DRIFT_PER_S = 1e-4  # what two quartz clocks may drift apart
RESTART_NS = 1_000_000_000  # a device time that steps back this far is a clock that began anew
LEAP_NS = 60_000_000_000  # and so is one that runs ahead of the host's clock this far between two packets


class Timebase:
    """Maps device times to the common time. `restarts` counts clocks that began anew."""

    def __init__(self) -> None:
        self.restarts = 0
        self._reference: str | None = None
        self._clocks: dict[str, tuple[float, int, int]] = {}  # host minus device, and both times when last seen

    def offset_ns(self, adapter: str, device_ns: int, host_ns: int) -> int:
        """What to add to this adapter's device times, given one just read at `host_ns`."""
        if self._reference is None:
            self._reference = adapter
        seen = host_ns - device_ns
        offset, last_host_ns, last_device_ns = self._clocks.get(adapter, (seen, host_ns, device_ns))
        ahead_ns = (device_ns - last_device_ns) - (host_ns - last_host_ns)
        if device_ns < last_device_ns - RESTART_NS or ahead_ns > LEAP_NS:
            self.restarts += 1
            offset = seen
        offset = min(seen, offset + (host_ns - last_host_ns) * DRIFT_PER_S)
        self._clocks[adapter] = (offset, host_ns, device_ns)
        if adapter == self._reference:
            return 0
        return round(offset - self._clocks[self._reference][0])

    @property
    def heard(self) -> bool:
        """Whether there is a common time yet."""
        return self._reference is not None

    def host_offset_ns(self, adapter: str | None = None) -> int:
        """What to add to device times of an adapter, or to common times, for the host's monotonic clock."""
        return round(self._clocks[adapter or str(self._reference)][0])
