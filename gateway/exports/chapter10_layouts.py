"""The packets of IRIG 106-13 Chapter 10 that an export has, as bytes: everything little-endian, no data checksum.

Times are counts of the relative time counter (RTC), 100 ns each, of which a packet has the low 48 bits.
"""

from collections.abc import Iterable
from datetime import datetime

import numpy as np
from construct import BytesInteger, Const, Int8ul, Int16ul, Int32ul, Int64ul, Struct
from numpy.typing import NDArray

TMATS, TIME, MESSAGE, ARINC_429 = 0x01, 0x11, 0x30, 0x38  # data types
RTC_HZ = 10_000_000
RTC_RANGE = 1 << 48
DATA_OVERFLOW = 0x10  # packet flag
LARGEST_GAP = 1_000_000  # 100 ms, 10.6.10: a longer one begins a packet; the field's 20 bits end at 104.8 ms
VERSION_2013 = 0x06  # of a packet's layout
TMATS_2013 = 0x0A  # as the setup record's own word counts versions

HEADER = Struct(
    "sync" / Const(0xEB25, Int16ul),
    "channel" / Int16ul,
    "packet_length" / Int32ul,
    "data_length" / Int32ul,
    "version" / Int8ul,
    "sequence" / Int8ul,
    "flags" / Int8ul,
    "type" / Int8ul,
    "rtc" / BytesInteger(6, swapped=True),
)
MESSAGE_HEAD = Struct("time" / Int64ul, "length" / Int16ul, "subchannel_and_errors" / Int16ul)
FORMAT_ERROR, DATA_ERROR = 1 << 14, 1 << 15  # of a message
SPEED_HIGH, PARITY_429, FORMAT_429 = 1 << 21, 1 << 22, 1 << 23  # bits of the word before an ARINC 429 word
REAL_TIME_CLOCK = 0x3 << 4  # time format; the source in the low bits is 0, the recorder itself
MONTH_AND_YEAR, LEAP_YEAR = 1 << 9, 1 << 8


def packet(
    channel: int, kind: int, sequence: int, rtc: int, data: bytes, flags: int = 0, version: int = VERSION_2013
) -> bytes:
    """A packet with its header, checksum and filler; `data` begins with the channel-specific data word."""
    filler = bytes(-len(data) % 4)
    head = HEADER.build(
        {
            "channel": channel,
            "packet_length": HEADER.sizeof() + 2 + len(data) + len(filler),
            "data_length": len(data),
            "version": version,
            "sequence": sequence % 256,
            "flags": flags,
            "type": kind,
            "rtc": rtc % RTC_RANGE,
        }
    )
    checksum = int(np.frombuffer(head, "<u2").sum(dtype=np.uint64)) % (1 << 16)
    return head + checksum.to_bytes(2, "little") + data + filler


def words_429(
    gaps: NDArray[np.int64], words: NDArray[np.uint32], errors: NDArray[np.uint32], bus: int, high_speed: bool
) -> bytes:
    """The entries of words (n,) in wire order: gaps since the word before (0 for a packet's first), error bits, bus."""
    entries = np.empty((len(words), 2), "<u4")
    entries[:, 0] = gaps.astype(np.uint32) | errors | np.uint32(bus << 24 | SPEED_HIGH * high_speed)
    entries[:, 1] = words
    return entries.tobytes()


def message(rtc: int, data: bytes, errors: int) -> bytes:
    """A message of subchannel 0 with its own time; an odd length is filled up."""
    head = MESSAGE_HEAD.build({"time": rtc % RTC_RANGE, "length": len(data), "subchannel_and_errors": errors})
    return head + data + bytes(len(data) % 2)


def time_data(utc: datetime) -> bytes:
    """The data of a time packet: a UTC to 10 ms with day, month and year."""
    leap = utc.year % 4 == 0 and (utc.year % 100 != 0 or utc.year % 400 == 0)
    word = REAL_TIME_CLOCK | MONTH_AND_YEAR | LEAP_YEAR * leap
    tens_of_ms = utc.microsecond // 10_000
    pairs = (tens_of_ms, utc.second, utc.minute, utc.hour, utc.day, utc.month, utc.year % 100, utc.year // 100)
    return word.to_bytes(4, "little") + bytes(pair // 10 << 4 | pair % 10 for pair in pairs)


def tmats_data(lines: Iterable[str]) -> bytes:
    """The data of a setup record in text."""
    return TMATS_2013.to_bytes(4, "little") + "".join(f"{line}\r\n" for line in lines).encode("ascii", "replace")
