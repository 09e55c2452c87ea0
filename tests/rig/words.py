"""What the rig's bridges say: numbered ARINC 429 words, each unlike its neighbours, packed by hand."""

import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

from cobs import cobs

CHANNEL = 3
WORDS_429 = 0x10
CAN_WORD, CAN_RADAR = 0, 1
CAN_FD_ROOM = 63


def word(number: int) -> int:
    return number * 0x9E37_79B1 % 2**32  # an odd factor: no two numbers share a word


def words(packet: int) -> list[int]:
    """The words of a packet, so that packets are of many lengths."""
    return [word(1000 * packet + entry) for entry in range(1 + packet % 40)]


def packet(number: int) -> bytes:
    """A RackLink packet on a stream; its number is its sequence."""
    body = b"".join(struct.pack("<II", 360_000 * entry, said) for entry, said in enumerate(words(number)))
    plain = struct.pack("<BBBBIQ", 1, WORDS_429, CHANNEL, 0, number, 20_000_000 * number) + body
    return bytes(cobs.encode(plain + struct.pack("<I", zlib.crc32(plain)))) + b"\0"


class Frame(NamedTuple):
    """A CAN frame with an identifier of 29 bits."""

    identifier: int
    data: bytes


def frame(number: int) -> Frame:
    """A CAN frame with one word."""
    return Frame(_identifier(CAN_WORD, word(number) & 0xFF), struct.pack("<II", word(number), 360 * number))


def frames(numbers: Iterable[int]) -> list[Frame]:
    return [frame(number) for number in numbers]


def radar_word(number: int) -> bytes:
    return bytes((number + position) % 256 for position in range(200))


def radar_frames(number: int) -> list[Frame]:
    """The FD frames of a radar word; the last one is filled up to a length that FD has, 24."""
    said = struct.pack("<QHB", 5_000_000 * number, 1600, 0) + radar_word(number)
    parts = [bytes([number % 256]) + said[start : start + CAN_FD_ROOM] for start in range(0, len(said), CAN_FD_ROOM)]
    parts[-1] = parts[-1].ljust(24, b"\0")
    return [Frame(_identifier(CAN_RADAR, segment), part) for segment, part in enumerate(parts)]


def _identifier(kind: int, index: int) -> int:
    return 0b10110 << 24 | CHANNEL << 16 | kind << 12 | index
