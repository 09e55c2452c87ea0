"""The loop over the packets of a byte stream, compiled; `decoders.racklink` says what it does with the rest.

CRC-32 is that of IEEE 802.3, eight bytes at a time with a table for each (Kounavis and Berry, 2005).
"""

import zlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from decoders import formats as f

Bytes = npt.NDArray[np.uint8]
Array = npt.NDArray[Any]
Int = Any  # of whatever width the loop has

SHORTEST: Final = f.LINK_HEADER_BYTES + f.LINK_CRC_BYTES
LONGEST: Final = f.LINK_MAX_BYTES
VERSION: Final = f.LINK_VERSION
CRC_RESIDUE: Final = zlib.crc32(bytes(f.LINK_CRC_BYTES))  # of all bytes that end with their CRC; that of none is 0
REFLECTED: Final = 0xEDB88320
FULL_GROUP: Final = 255  # a COBS code after which no zero is left out


def _tables() -> npt.NDArray[np.uint32]:
    """(8, 256): what a byte adds to the CRC, seven to none bytes further on."""
    rows = np.zeros((8, 256), np.uint32)
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = crc >> 1 ^ REFLECTED * (crc & 1)
        rows[0, byte] = crc
    for k in range(1, 8):
        rows[k] = rows[k - 1] >> np.uint32(8) ^ rows[0, rows[k - 1] & 255]
    return rows


TABLES: Final = _tables()


@njit(cache=True)
def intact(data: Bytes, at: int, tables: Array, decoded: Bytes, found: Array, count: int) -> tuple[int, int]:
    """Take packets from data[at:] until one is not intact and of version 1, or not whole.

    Writes them without COBS to `decoded` from where the packet before ended, and a row of start, size and the place
    behind its closing zero in `data` each to `found` i8 (m, 3). Gives the new count, and where it stopped.
    """
    to = found[count - 1, 0] + found[count - 1, 1] if count else 0
    while count < found.shape[0]:
        size, end = _unstuffed(data, at, decoded, to)
        if (
            size < SHORTEST
            or size > LONGEST
            or decoded[to] != VERSION
            or crc32(decoded, to, to + size, tables) != CRC_RESIDUE
        ):
            break
        found[count] = to, size, end
        count += 1
        to += size
        at = end
    return count, at


@njit(cache=True)
def _unstuffed(data: Bytes, at: Int, decoded: Bytes, to: Int) -> tuple[Int, Int]:
    """Decode one run; its size, 0 if it is not sound or not whole, and the place behind its closing zero."""
    begin = to
    while at < data.size:
        code = np.int64(data[at])
        if code == 0:
            return to - begin, at + 1
        if at + code >= data.size:  # at least a closing zero must follow
            break
        for k in range(1, code):
            byte = data[at + k]
            if byte == 0:
                return 0, at
            decoded[to] = byte
            to += 1
        at += code
        if code < FULL_GROUP and data[at] != 0:
            decoded[to] = 0
            to += 1
    return 0, at


@njit(cache=True)
def crc32(data: Bytes, start: Int, end: Int, tables: Array) -> Int:
    """The CRC-32 of data[start:end]."""
    crc = np.uint32(0xFFFFFFFF)
    at = start
    while end - at >= 8:
        crc = (
            tables[7, (crc & 255) ^ data[at]]
            ^ tables[6, (crc >> 8 & 255) ^ data[at + 1]]
            ^ tables[5, (crc >> 16 & 255) ^ data[at + 2]]
            ^ tables[4, (crc >> 24) ^ data[at + 3]]
            ^ tables[3, data[at + 4]]
            ^ tables[2, data[at + 5]]
            ^ tables[1, data[at + 6]]
            ^ tables[0, data[at + 7]]
        )
        at += 8
    while at < end:
        crc = tables[0, (crc & 255) ^ data[at]] ^ (crc >> 8)
        at += 1
    return crc ^ np.uint32(0xFFFFFFFF)
