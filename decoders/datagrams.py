"""Datagrams as the gateway records them, to packets: RackLink 1, one packet each, or bare radar words without a link.

A chunk is `formats.DATAGRAM_RECORD` and the datagram, again and again.
"""

import struct
from collections.abc import Iterator
from typing import ClassVar, Final

from decoders import formats as f
from decoders.framing import Packet, PacketFramer
from decoders.racklink import Framer, parsed

RECORD: Final = struct.Struct(f.DATAGRAM_RECORD)


def split(chunk: bytes) -> Iterator[tuple[int, bytes]]:
    """Arrival in ns of the host's monotonic clock and bytes of each datagram; one that is not whole ends it."""
    at = 0
    while at + RECORD.size <= len(chunk):
        arrival_ns, size = RECORD.unpack_from(chunk, at)
        at += RECORD.size + size
        if at > len(chunk):
            return
        yield arrival_ns, chunk[at - size : at]


class DatagramFramer(Framer):
    """One packet a datagram, without COBS or a closing 0x00; faults are named as on a stream.

    Counts the whole chunk: what is recorded beside a good datagram counts as framed with it.
    """

    frame = PacketFramer.frame  # chunk by chunk, not as one stream

    def feed(self, data: bytes) -> list[Packet]:
        """The packets of a chunk of datagrams."""
        self.received += len(data)
        packets, rest = [], len(data)
        for _, datagram in split(data):
            size = RECORD.size + len(datagram)
            packets += self._account(parsed(datagram), size)
            rest -= size
        self.skipped += rest
        self._check_books()
        return packets


class BareFramer(PacketFramer):
    """A sender without a link format: each datagram is one radar word of channel 0, timed by its arrival.

    The clock of the packets is the host's; words that are lost on the way cannot be noticed.
    """

    NAMES: ClassVar = (*PacketFramer.NAMES, "timed_by_arrival")
    announces: ClassVar = False

    def __init__(self) -> None:
        super().__init__()
        self.timed_by_arrival = 0

    def feed(self, data: bytes) -> list[Packet]:
        """A packet for each datagram of a chunk; one that no radar word can be as long as is skipped."""
        self.received += len(data)
        packets, framed = [], 0
        for arrival_ns, word in split(data):
            if 1 <= len(word) <= f.LINK_MAX_BYTES:
                framed += RECORD.size + len(word)
                body = (8 * len(word)).to_bytes(2, "little") + word
                packets.append(Packet(f.WORD_708, 0, 0, self.timed_by_arrival & 0xFFFFFFFF, arrival_ns, body))
                self.timed_by_arrival += 1
        self.framed += framed
        self.skipped += len(data) - framed
        self._check_books()
        return packets
