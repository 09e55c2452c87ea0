"""The flight of the gateway's tests as the files of other recorders, written field by field, and candump lines."""

import struct
from collections.abc import Iterable, Iterator

from cobs import cobs

Word = tuple[int, int, bytes]  # channel, time in ns, and the word: 4 bytes of ARINC 429 or 200 of ARINC 708


def words_of(frames: Iterable[bytes]) -> Iterator[Word]:
    """The bus words of COBS frames of RackLink, one by one in the order of the link."""
    for frame in frames:
        packet = cobs.decode(frame[:-1])
        _, kind, channel, _, _, time_ns = struct.unpack_from("<BBBBIQ", packet)
        body = packet[16:-4]
        if kind == 0x10:
            for offset, word in struct.iter_unpack("<I4s", body):
                yield channel, time_ns + offset, word
        elif kind == 0x20:
            yield channel, time_ns, body[2:]


def seqrecord(word: Word, start_us: int = 0) -> bytes:
    """A Ballard record with a clock of 1 us."""
    channel, time_ns, data = word
    ticks = start_us + time_ns // 1000
    low, high = ticks & 0xFFFFFFFF, ticks >> 32
    if len(data) == 4:
        return struct.pack("<HHIHH4sI", 0x0101, 10, low, channel << 8 | 1, 0, data, high)
    return struct.pack("<HHIHH232sHHI", 0x0104, 126, low, channel << 8 | 1, 100, data, 1600, 0, high)


def mxf(word: Word) -> bytes:
    """A MAX Technologies record with a clock of 1 ns."""
    _, time_ns, data = word
    if len(data) == 4:
        return struct.pack("<QII4sI", time_ns, 0, 0, data, 0)
    return struct.pack("<QIIII256s", time_ns, 0, 100, 0, 0, data)


def rdr4b(word: Word) -> bytes:
    """A record of an RDR-4B's file."""
    return b"prefix of 18 bytes" + word[2]
