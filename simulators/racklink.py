"""Encode RackLink 1 packets, the link from a bus bridge to the gateway: little-endian, CRC-32, COBS, one zero byte."""

import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from cobs import cobs

from decoders.formats import (
    LINK_CRC_BYTES,
    LINK_HEADER,
    LINK_HEADER_BYTES,
    LINK_MAX_BYTES,
    LINK_MAX_WORDS,
    LINK_VERSION,
    WORD_708,
    WORDS_429,
)


class Packet(NamedTuple):
    """A numbered packet before it is bytes; `time_ns` by the device clock, `body` as the functions below make it."""

    type: int
    channel: int
    flags: int
    sequence: int
    time_ns: int
    body: bytes

    @property
    def words(self) -> int:
        """How many bus words it holds."""
        return {WORDS_429: len(self.body) // 8, WORD_708: 1}.get(self.type, 0)


def encode(type: int, channel: int, sequence: int, time_ns: int, body: bytes, flags: int = 0) -> bytes:  # noqa: A002
    """One packet as it goes down a serial line. Raises ValueError when it would exceed 4096 bytes before COBS."""
    return framed(packed(Packet(type, channel, flags, sequence, time_ns, body)))


def packed(packet: Packet) -> bytes:
    """Header, body and CRC. Raises ValueError over 4096 bytes."""
    kind, channel, flags, sequence, time_ns, body = packet
    checked = struct.pack(LINK_HEADER, LINK_VERSION, kind, channel, flags, sequence % 2**32, time_ns) + body
    size = len(checked) + LINK_CRC_BYTES
    if size > LINK_MAX_BYTES:
        raise ValueError(f"a packet of {size} bytes is over the limit of {LINK_MAX_BYTES}: send a shorter body")
    return checked + struct.pack("<I", zlib.crc32(checked))


def unpacked(packet: bytes) -> Packet:
    """The packet of bytes that `packed` has made."""
    _, kind, channel, flags, sequence, time_ns = struct.unpack_from(LINK_HEADER, packet)
    return Packet(kind, channel, flags, sequence, time_ns, packet[LINK_HEADER_BYTES:-LINK_CRC_BYTES])


def framed(packet: bytes) -> bytes:
    """COBS and the closing zero byte."""
    return bytes(cobs.encode(packet)) + b"\0"


def unframed(frame: bytes) -> bytes:
    """The packet of bytes that `framed` has made."""
    return bytes(cobs.decode(frame[:-1]))


def hello(serial_number: int, firmware: int, channels: Iterable[tuple[int, int, int, int]]) -> bytes:
    """Body of a hello; a channel is (number, kind, orientation, low byte of the equipment identity)."""
    listed = b"".join(struct.pack("<BBBB", *channel) for channel in channels)
    return struct.pack("<IH", serial_number, firmware) + listed


def heartbeat(counts: Iterable[tuple[int, int, int]]) -> bytes:
    """Body of a heartbeat; a count is (channel, words received, words lost in the device)."""
    return b"".join(struct.pack("<BII", channel, got % 2**32, lost % 2**32) for channel, got, lost in counts)


def words_429(offsets_ns: Sequence[int], words: Sequence[int]) -> bytes:
    """Body of 1 to 256 ARINC 429 words, each with its ns after the packet's time; raises ValueError otherwise."""
    if not 1 <= len(words) <= LINK_MAX_WORDS:
        raise ValueError(f"a packet holds 1 to {LINK_MAX_WORDS} ARINC 429 words, not {len(words)}")
    return b"".join(struct.pack("<II", *pair) for pair in zip(offsets_ns, words, strict=True))


def word_708(word: bytes, bits: int | None = None) -> bytes:
    """Body of one ARINC 708 word; `bits` tells a length that is not a whole number of bytes."""
    return struct.pack("<H", 8 * len(word) if bits is None else bits) + word
