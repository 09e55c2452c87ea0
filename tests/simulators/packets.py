"""A bridge's packets taken apart by hand."""

import struct
import zlib
from dataclasses import dataclass

from cobs import cobs


@dataclass(frozen=True)
class Parsed:
    """One packet and the device time at which it was complete."""

    ready_ns: int
    type: int
    channel: int
    flags: int
    sequence: int
    time_ns: int
    body: bytes

    def words(self) -> list[tuple[int, int]]:
        """Start in device time and word of each ARINC 429 word."""
        return [(self.time_ns + offset, word) for offset, word in struct.iter_unpack("<II", self.body)]


def parse(ready_ns: int, encoded: bytes) -> Parsed:
    assert encoded.endswith(b"\0")
    assert encoded.count(0) == 1
    packet = cobs.decode(encoded[:-1])
    assert struct.unpack("<I", packet[-4:]) == (zlib.crc32(packet[:-4]),)
    version, kind, channel, flags, sequence, time_ns = struct.unpack("<BBBBIQ", packet[:16])
    assert version == 1
    return Parsed(ready_ns, kind, channel, flags, sequence, time_ns, packet[16:-4])


def label_of(word: int) -> int:
    return int(f"{word & 0xFF:08b}"[::-1], 2)


def ssm_of(word: int) -> int:
    return word >> 29 & 3


def signed(word: int, first_bit: int) -> int:
    """Two's complement from `first_bit` to the sign in bit 29."""
    width = 30 - first_bit
    raw = word >> (first_bit - 1) & ((1 << width) - 1)
    return raw - (raw >> (width - 1) << width)
