"""The loop over the packets of a byte stream, compiled; `decoders.racklink` says what it does with the rest."""

import zlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from decoders import formats as f
from decoders.kernels_crc import crc32, word

Bytes = npt.NDArray[np.uint8]
Array = npt.NDArray[Any]
Int = Any  # of whatever width the loop has

SHORTEST: Final = f.LINK_HEADER_BYTES + f.LINK_CRC_BYTES
LONGEST: Final = f.LINK_MAX_BYTES
LONGEST_ENCODED: Final = f.LINK_MAX_ENCODED_BYTES
VERSION: Final = f.LINK_VERSION
CRC_RESIDUE: Final = zlib.crc32(bytes(f.LINK_CRC_BYTES))  # of all bytes that end with their CRC; that of none is 0
ENTRY_BYTES: Final = f.ENTRY_429_BYTES
MOST_WORDS: Final = f.LINK_MAX_WORDS
FULL_GROUP: Final = 255  # a COBS code after which no zero is left out
LOWS: Final = 0x0101010101010101  # of each byte of a word, the lowest bit
HIGHS: Final = 0x8080808080808080


@njit(cache=True)
def intact(data: Bytes, at: int, decoded: Bytes, found: Array, count: int) -> tuple[int, int]:
    """Take packets from data[at:] until one is not intact and of version 1, or not whole.

    `decoded` is a copy of `data`, in which packets lose their COBS where they lie; a row of start and size there and
    the place behind the closing zero goes to `found` i8 (m, 3) for each. Gives the new count, and where it stopped.
    """
    while count < found.shape[0]:
        end = _closing_zero(data, at)
        if end == data.size or end - at > LONGEST_ENCODED:
            break
        start = _unstuffed(data, at, end, decoded)
        size = end - start
        if (
            size < SHORTEST
            or size > LONGEST
            or decoded[start] != VERSION
            or crc32(decoded, start, end, 0) != CRC_RESIDUE
        ):
            break
        at = end + 1
        found[count] = start, size, at
        count += 1
    return count, at


@njit(cache=True)
def described(decoded: Bytes, found: Array, ends: Array, header: Array, chunk: Array) -> None:
    """Of each packet in `found`, the 16 bytes of its header, as `header` u8 (m, 2), and which chunk completes it.

    `ends` are the places where the chunks end.
    """
    k = 0
    for i in range(found.shape[0]):
        while ends[k] < found[i, 2]:
            k += 1
        chunk[i] = k
        start = np.uint64(found[i, 0])
        header[i, 0], header[i, 1] = word(decoded, start), word(decoded, start + np.uint64(8))


@njit(cache=True)
def entries(  # type: ignore[no-untyped-def] # typed by racklink.joined429
    data, start, size, device_ns, offset_ns, time_ns, sent_ns, words, count
):
    """Read the entries of an ARINC 429 packet, the body of which is data[start : start + size].

    Behind the first `count` of their arrays they put when words were sent, the same by the common clock, and the words.
    Gives how many words there are then, whether the packet is malformed, and how many words of it are left out.
    """
    whole, before, backwards = np.int64(size) // ENTRY_BYTES, np.uint64(0), False
    for k in range(whole):
        entry = word(data, np.uint64(start + ENTRY_BYTES * k))
        after = entry & np.uint64(0xFFFFFFFF)
        backwards |= after < before
        before = after
        time_ns[count + k] = device_ns + np.int64(after)
        sent_ns[count + k] = time_ns[count + k] + offset_ns
        words[count + k] = entry >> np.uint64(32)
    if backwards:
        return count, True, whole
    return count + whole, whole * ENTRY_BYTES != size or not 1 <= whole <= MOST_WORDS, 0


@njit(cache=True)
def _closing_zero(data: Bytes, start: Int) -> Int:
    """Where the first zero from `start` on is, or the end; it is sought in eight bytes at once (Mycroft, 1987)."""
    at, size = np.uint64(start), np.uint64(data.size)
    while at + np.uint64(8) <= size:
        eight = word(data, at)
        if (eight - np.uint64(LOWS)) & ~eight & np.uint64(HIGHS):
            break
        at += np.uint64(8)
    while at < size and data[at]:
        at += np.uint64(1)
    return np.int64(at)


@njit(cache=True)
def _unstuffed(data: Bytes, begin: Int, end: Int, decoded: Bytes) -> Int:
    """Decode the run data[begin:end]; where it begins then, or `end` if it is not sound.

    It lies there but for its codes: most become the zero that they stand for, and the first one, as any behind a full
    group, stands for none: what is before it moves up.
    """
    start, at, stop, code = begin, np.uint64(begin), np.uint64(end), np.uint64(FULL_GROUP)
    while at < stop:
        if code == FULL_GROUP:
            for k in range(np.int64(at), start, -1):
                decoded[k] = decoded[k - 1]
            start += 1
        else:
            decoded[at] = 0
        code = np.uint64(data[at])
        at += code
    return start if at == stop else end
