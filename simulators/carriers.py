"""What goes down a line for one packet: a COBS frame, a datagram, CAN frames, or the text lines of such frames.

CAN carries no hello, no sequence and no flags of ARINC 429 words: what a line does not say, the gateway is told by
its configuration and by the heartbeats.
"""

import struct
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, TypeVar

from decoders.formats import (
    CAN_429,
    CAN_708_HEAD,
    CAN_COUNTS,
    CAN_FD_LENGTHS,
    CAN_HEARTBEAT,
    CAN_PREFIX,
    CAN_SEGMENT_BYTES,
    CAN_WORD_429,
    CAN_WORD_708,
    HEARTBEAT,
    WORD_708,
    WORDS_429,
)
from simulators import racklink
from simulators.racklink import Packet


class Frame(NamedTuple):
    """A CAN data frame with a 29-bit identifier, or with one of 11 bits that is not a bridge's."""

    id: int
    data: bytes
    fd: bool
    extended: bool = True


Unit = TypeVar("Unit", bytes, Frame)
Name = Literal["stream", "datagram", "can", "slcan"]


@dataclass(frozen=True)
class Carrier(Generic[Unit]):
    """A way to put packets on a line: `units(packet)` are what goes down the line for it, in order."""

    name: Name
    units: Callable[[Packet], Sequence[Unit]]


def stream() -> Carrier[bytes]:
    """A byte stream, such as a serial line, a USB bulk pipe or TCP: a COBS frame with its closing zero byte."""
    return Carrier("stream", lambda packet: [racklink.framed(racklink.packed(packet))])


def datagram() -> Carrier[bytes]:
    """A datagram holds one packet with its CRC, without COBS."""
    return Carrier("datagram", lambda packet: [racklink.packed(packet)])


def can(fd: bool = False) -> Carrier[Frame]:
    """CAN frames, all classic or all FD. Radar words of each channel are counted from 0, so the carrier has a state."""
    return Carrier("can", _Framer(fd).frames)


def slcan(fd: bool = False) -> Carrier[bytes]:
    """CAN frames as the text lines of a serial CAN adapter; FD frames have the bit rate switched."""
    frames = _Framer(fd).frames
    return Carrier("slcan", lambda packet: [slcan_line(frame) for frame in frames(packet)])


def slcan_line(frame: Frame) -> bytes:
    """The frame as text. Raises ValueError for a number of data bytes that CAN does not have."""
    length = CAN_FD_LENGTHS.index(len(frame.data))
    command, digits = ("B" if frame.fd else "T"), 8
    if not frame.extended:
        command, digits = command.lower(), 3
    return f"{command}{frame.id:0{digits}X}{length:X}{frame.data.hex().upper()}\r".encode()


class _Framer:
    """Packets to frames, with a counter of the radar words of each channel."""

    def __init__(self, fd: bool) -> None:
        self._fd = fd
        self._room = CAN_SEGMENT_BYTES["fd" if fd else "classic"]
        self._radar_words: Counter[int] = Counter()
        self._forms = {WORDS_429: self._words, WORD_708: self._segments, HEARTBEAT: self._counts}

    def frames(self, packet: Packet) -> list[Frame]:
        """The frames of a packet; none for a type that has no form on CAN."""
        form = self._forms.get(packet.type)
        return form(packet) if form else []

    def _frame(self, channel: int, kind: int, index: int, data: bytes) -> Frame:
        return Frame(CAN_PREFIX << 24 | channel << 16 | kind << 12 | index, data, self._fd)

    def _words(self, packet: Packet) -> list[Frame]:
        """One frame a word, with the low byte of the word in the identifier."""
        return [
            self._frame(
                packet.channel,
                CAN_WORD_429,
                word & 0xFF,
                struct.pack(CAN_429, word, (packet.time_ns + offset_ns) // 1000 % 2**32),
            )
            for offset_ns, word in struct.iter_unpack("<II", packet.body)
        ]

    def _segments(self, packet: Packet) -> list[Frame]:
        """Head and word cut into segments, each behind the counter; the last one padded to a length that FD has."""
        (bits,) = struct.unpack_from("<H", packet.body)
        content = struct.pack(CAN_708_HEAD, packet.time_ns, bits, packet.flags) + packet.body[2:]
        counter = bytes([self._radar_words[packet.channel] % 256])
        self._radar_words[packet.channel] += 1
        return [
            self._frame(packet.channel, CAN_WORD_708, index, _padded(counter + content[start : start + self._room]))
            for index, start in enumerate(range(0, len(content), self._room))
        ]

    def _counts(self, packet: Packet) -> list[Frame]:
        """One frame a channel."""
        return [
            self._frame(channel, CAN_HEARTBEAT, 0, struct.pack(CAN_COUNTS, received, lost))
            for channel, received, lost in struct.iter_unpack("<BII", packet.body)
        ]


def _padded(data: bytes) -> bytes:
    return data.ljust(next(length for length in CAN_FD_LENGTHS if length >= len(data)), b"\0")
