"""The records of makers' interface cards: layouts, types and flags as numbers. All are little-endian.

The layouts are public. What the cards' makers document with them stands under "known"; what no public source says
stands under "assumed", and a rack file or an option of `shadebus import` can say otherwise.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from decoders import formats as f

SEQRECORD_429: Final = np.dtype(
    [
        ("type", "<u2"),
        ("count", "<u2"),
        ("timestamp", "<u4"),
        ("activity", "<u2"),
        ("decoder_gap", "<u2"),
        ("data", "<u4"),
        ("timestamp_high", "<u4"),
    ]
)
SEQRECORD_708: Final = np.dtype(
    [
        ("type", "<u2"),
        ("count", "<u2"),
        ("timestamp", "<u4"),
        ("activity", "<u2"),
        ("data_count", "<u2"),
        ("data", "V232"),  # 100 words of 16 bits and 16 more for long words
        ("bit_count", "<u2"),
        ("reserved", "<u2"),
        ("timestamp_high", "<u4"),
    ]
)
MXF_A429: Final = np.dtype(
    [("time_tag", "<u8"), ("control", "<u4"), ("repeat_count", "<u4"), ("data", "<u4"), ("reserved", "<u4")]
)
MXF_A708: Final = np.dtype(
    [
        ("time_tag", "<u8"),
        ("control", "<u4"),
        ("data_size", "<u4"),
        ("repeat_count", "<u4"),
        ("manchester_bit_error", "<u4"),
        ("data", "V256"),  # 128 words of 16 bits
    ]
)
RDR4B: Final = np.dtype([("prefix", "V18"), ("data", f"V{f.WORD_708_BYTES}")])

# --- Known: Ballard's programming manuals and headers -----------------------------------------------------------------
SEQRECORD_TYPE_MASK: Final = 0x00FF  # the high byte is the version of the record
SEQRECORD_TYPE_429: Final = 1
SEQRECORD_TYPE_708: Final = 4
SEQRECORD_OTHER_TYPES: Final = (2, 3, 5, 6, 7, 8)  # other buses, of which only `count` is read
SEQRECORD_COUNT_BYTES: Final = 2  # `count` is the size of the whole record in words of 16 bits
SEQRECORD_SHORTEST, SEQRECORD_LONGEST = 12, 4096  # bytes that a record of another bus may have; the latter assumed
SEQRECORD_CHANNEL: Final = 0xFF00  # of `activity`
SEQRECORD_FLAGS_429: Final = {
    f.FLAG_PARITY: 0x0010,
    f.FLAG_CODING: 0x0004,  # bit time
    f.FLAG_WORD_LENGTH: 0x000A,  # too long; timed out, hence too short
    f.FLAG_SYNC: 0x0020,  # a gap of less than four bit times, which is what delimits ARINC 429 words
}
SEQRECORD_FLAGS_708: Final = {
    f.FLAG_CODING: 0x0014,  # Manchester; "word error"
    f.FLAG_WORD_LENGTH: 0x0062,  # too short, too long, timed out
    f.FLAG_SYNC: 0x0008,  # none at the end
}

# --- Assumed ----------------------------------------------------------------------------------------------------------
# The flags of MAX Technologies' `control` have public names (parity error; too long, Manchester, sync at the beginning
# and at the end, not enough bits, too many bits) but no public places. So any bit that is set spoils the word: a word
# that is good after all is then counted and not used, rather than a bad one used.
MXF_FLAGS_429: Final = {f.FLAG_PARITY: 0xFFFF_FFFF}
MXF_FLAGS_708: Final = {f.FLAG_CODING: 0xFFFF_FFFF}
MXF_SIZE_BITS: Final = 16  # of one unit of `data_size`
SEQRECORD_TICK_NS: Final = 1000  # cards of the third to fifth generation as delivered; those of the sixth count ns
MXF_TICK_NS: Final = 1
RDR4B_WORDS_PER_S: Final = 190.0  # at which an RDR-4B sends; its file has no times


@dataclass(frozen=True)
class Reading:
    """What a layout leaves open: how long a tick is, the masks of error flags, and more for one layout each."""

    tick_ns: int = 1
    flags_429: dict[int, int] = field(default_factory=dict)  # our flag to the maker's bits
    flags_708: dict[int, int] = field(default_factory=dict)
    size_bits: int = MXF_SIZE_BITS
    words_per_s: float = RDR4B_WORDS_PER_S


READINGS: Final = {
    "seqrecord": Reading(SEQRECORD_TICK_NS, SEQRECORD_FLAGS_429, SEQRECORD_FLAGS_708),
    "mxf429": Reading(MXF_TICK_NS, flags_429=MXF_FLAGS_429),
    "mxf708": Reading(MXF_TICK_NS, flags_708=MXF_FLAGS_708),
    "rdr4b": Reading(),
}
