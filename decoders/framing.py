"""What every framer promises: recorded chunks of one adapter in, packets out, and no byte unaccounted for."""

from typing import ClassVar, NamedTuple


class Packet(NamedTuple):
    """An intact packet, of a known type or not. `time_ns` is the device clock at the start of the first word."""

    type: int
    channel: int
    flags: int
    sequence: int
    time_ns: int
    body: bytes


class PacketFramer:
    """Bytes: `received` = `framed` + `skipped` + `pending` after every call. `feed` never raises on data."""

    NAMES: ClassVar[tuple[str, ...]] = ("received", "framed", "skipped", "pending")  # of the counters
    announces: ClassVar[bool] = True  # whether a bridge can say hello in this form

    def __init__(self) -> None:
        self.received = self.framed = self.skipped = 0

    @property
    def pending(self) -> int:
        """Bytes kept for the next call."""
        return 0

    def feed(self, data: bytes) -> list[Packet]:
        """Packets completed by the next chunk."""
        raise NotImplementedError

    def counters(self) -> dict[str, int]:
        """Every counter by name."""
        return {name: getattr(self, name) for name in self.NAMES}

    def succeed(self, before: "PacketFramer") -> None:
        """Take over the counts of a framer that is given up; what it still had pending counts as skipped."""
        for name, count in before.counters().items():
            if name != "pending":
                setattr(self, name, count)
        self.skipped += before.pending

    def _check_books(self) -> None:
        if self.received != self.framed + self.skipped + self.pending:
            raise AssertionError(f"framer lost count of its bytes: {self.counters()}")
