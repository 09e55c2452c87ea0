"""One time for all bridges: the device clock of the first bridge that spoke.

Words of one bridge keep their own device times exactly. Another bridge's clock is laid beside it through the host's
monotonic clock: the smallest delay from stamp to reading seen so far stands for the true offset, since delays only ever
add, and is let up slowly so that drifting clocks are followed.
"""

DRIFT_PER_S = 1e-4  # what two quartz clocks may drift apart
RESET_NS = 5_000_000_000  # a device time that steps back this far, or a delay this much longer, is a restarted clock


class Timebase:
    """Maps device times to the common time. `restarts` counts clocks that began anew."""

    def __init__(self) -> None:
        self.restarts = 0
        self._reference: str | None = None
        self._offsets: dict[str, tuple[float, int]] = {}  # host minus device in ns, and the host time it was seen

    def offset_ns(self, adapter: str, device_ns: int, host_ns: int) -> int:
        """What to add to this adapter's device times, given one just read at `host_ns`."""
        if self._reference is None:
            self._reference = adapter
        seen = host_ns - device_ns
        offset, since = self._offsets.get(adapter, (seen, host_ns))
        if abs(seen - offset) > RESET_NS and adapter != self._reference:
            self.restarts += 1
            offset = seen
        offset = min(seen, offset + (host_ns - since) * DRIFT_PER_S)
        self._offsets[adapter] = (offset, host_ns)
        if adapter == self._reference:
            return 0
        return round(offset - self._offsets[self._reference][0])
