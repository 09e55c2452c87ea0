"""What every framer promises: recorded chunks of one adapter in, packets out, and no byte unaccounted for."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from decoders import formats as f

HEADER_FIELDS: Final = ("version", "type", "channel", "flags", "sequence", "time_ns")
HEADER: Final = np.dtype(list(zip(HEADER_FIELDS, ("u1", "u1", "u1", "u1", "<u4", "<u8"), strict=True)))


class Packet(NamedTuple):
    """An intact packet, of a known type or not. `time_ns` is the device clock at the start of the first word."""

    type: int
    channel: int
    flags: int
    sequence: int
    time_ns: int
    body: bytes


class Packets(NamedTuple):
    """Intact packets in order, a column each: `header` (n,) of `HEADER`, and which `chunk` each was completed by.

    The body of packet k is `data[start[k] : start[k] + size[k]]`.
    """

    header: npt.NDArray[Any]
    start: npt.NDArray[np.int64]
    size: npt.NDArray[np.int64]
    chunk: npt.NDArray[np.int64]
    data: npt.NDArray[np.uint8]

    def of(self, which: "npt.NDArray[np.intp] | slice") -> "Packets":
        """Some of them."""
        return Packets(self.header[which], self.start[which], self.size[which], self.chunk[which], self.data)

    def packet(self, k: int) -> Packet:
        """One of them as an object."""
        _, kind, channel, flags, sequence, time_ns = self.header[k].item()
        return Packet(
            kind, channel, flags, sequence, time_ns, self.data[self.start[k] : self.start[k] + self.size[k]].tobytes()
        )


def columns(packets: Sequence[Packet], chunks: Sequence[int]) -> Packets:
    """Packets as columns."""
    size = np.array([len(packet.body) for packet in packets], np.int64)
    return Packets(
        np.array([(f.LINK_VERSION, *packet[:-1]) for packet in packets], HEADER),
        np.cumsum(size) - size,
        size,
        np.array(chunks, np.int64),
        np.frombuffer(b"".join(packet.body for packet in packets), np.uint8),
    )


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

    def frame(self, data: npt.NDArray[np.uint8], ends: npt.NDArray[np.int64]) -> Packets:
        """Packets completed by the next chunks, many at once: these lie one behind the other and end at `ends`."""
        bounds = pairwise((0, *ends.tolist()))
        fed = [(packet, k) for k, (a, b) in enumerate(bounds) for packet in self.feed(data[a:b].tobytes())]
        return columns([packet for packet, _ in fed], [k for _, k in fed])

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
