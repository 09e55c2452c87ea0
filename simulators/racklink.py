"""Encode RackLink 1 packets, the link from a bus bridge to the gateway: little-endian, CRC-32, COBS, one zero byte."""

import struct
import zlib
from collections.abc import Iterable, Sequence

from cobs import cobs

from decoders.formats import LINK_HEADER, LINK_MAX_BYTES, LINK_MAX_WORDS, LINK_VERSION


def encode(type: int, channel: int, sequence: int, time_ns: int, body: bytes, flags: int = 0) -> bytes:  # noqa: A002
    """One packet as it goes down the line. Raises ValueError when it would exceed 4096 bytes before COBS."""
    packet = struct.pack(LINK_HEADER, LINK_VERSION, type, channel, flags, sequence % 2**32, time_ns) + body
    packet += struct.pack("<I", zlib.crc32(packet))
    if len(packet) > LINK_MAX_BYTES:
        raise ValueError(f"a packet of {len(packet)} bytes is over the limit of {LINK_MAX_BYTES}: send a shorter body")
    return bytes(cobs.encode(packet)) + b"\0"


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
