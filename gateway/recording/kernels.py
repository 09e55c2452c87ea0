"""The loop over raw records that are whole, compiled; `gateway.recording.reader` says what it does with the rest."""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from decoders.kernels_crc import crc32
from gateway.chunks import BEGIN, DROPPED_BEFORE, END, MONOTONIC_NS, NUMBER, SEQUENCE, UTC_NS
from gateway.recording.layout import RAW_HEAD

MESSAGE: Final = 5  # the opcode
# Of a raw record, in front of its chunk: the message of MCAP, and our payload whose CRC-32 covers what comes after it.
RAW_FIELDS: Final = (
    *("opcode", "length", "channel", "low", "log_ns", "published_ns"),
    *("crc", "sequence", "monotonic_ns", "utc_ns", "dropped_before"),
)
RAW_TYPES: Final = ("u1", "<u8", "<u2", "<u4", "<u8", "<u8", "<u4", "<u8", "<u8", "<u8", "<u4")
RAW_RECORD: Final = np.dtype(list(zip(RAW_FIELDS, RAW_TYPES, strict=True)))
RAW_BYTES: Final = RAW_RECORD.itemsize
BEFORE_LENGTH: Final = 9  # bytes that `length` does not count
GUARDED: Final = RAW_BYTES - RAW_HEAD.size  # where what the CRC-32 covers begins
KNOWN: Final = 1 << 32  # of a channel: above the CRC-32 to go on from
CHANNELS: Final = 1 << 16

Int = Any  # of whatever width the loop has


@njit(cache=True)
def raw_records(
    data: NDArray[np.uint8], at: Int, seeds: NDArray[np.int64], columns: NDArray[np.uint64]
) -> tuple[int, int]:
    """Take raw records from data[at:] until one is not whole, or not raw, or there is no more room in `columns`.

    `seeds` i8 (65536,) has by channel what its CRCs begin with, and `KNOWN`; 0 of one that is not known. `columns` gets
    what `Chunks` says, channels as the numbers of adapters. Gives how many there are, and where it stopped.
    """
    count = 0
    while count < columns.shape[1] and at + RAW_BYTES <= data.size:
        head = data[at : at + RAW_BYTES].view(RAW_RECORD)[0]
        seed = seeds[head.channel]
        fits = RAW_BYTES - BEFORE_LENGTH <= head.length <= np.uint64(data.size - at - BEFORE_LENGTH)
        if head.opcode != MESSAGE or not seed or not fits or head.low != head.sequence & np.uint64(0xFFFFFFFF):
            break
        if not head.log_ns == head.published_ns == head.utc_ns:
            break
        end = at + BEFORE_LENGTH + np.int64(head.length)
        if crc32(data, at + GUARDED, end, seed) != head.crc:
            break
        columns[SEQUENCE, count] = head.sequence
        columns[MONOTONIC_NS, count] = head.monotonic_ns
        columns[UTC_NS, count] = head.utc_ns
        columns[DROPPED_BEFORE, count] = head.dropped_before
        columns[NUMBER, count] = head.channel
        columns[BEGIN, count] = at + RAW_BYTES
        columns[END, count] = end
        count += 1
        at = end
    return count, at
