"""The loops over the headers of ARINC 708 words, compiled; `decoders.arinc708` checks the arguments.

Numba freezes module constants into its cache, so what a profile may change comes as arguments.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from decoders import formats as f
from decoders.results708 import Header, Meanings

Int = int | np.int64
Array = npt.NDArray[Any]
Bytes = npt.NDArray[np.uint8]
Place = tuple[Int, Int]
Parts = tuple[Array, Array, Array]


def _field(name: str) -> Place:
    """Where a field is. Of plain numbers the compiler would make all of a function anew for each field: seconds."""
    first, width = f.HEADER_708[name]
    return np.int64(first), np.int64(width)


HEADER_BYTES: Final = f.HEADER_708_BYTES
LABEL: Final = _field("label")
CONTROL_ACCEPT: Final = _field("control_accept")
SLAVE: Final = _field("slave")
ANNUNCIATIONS: Final = _field("annunciations")
FAULTS: Final = _field("faults")
STABILISED: Final = _field("stabilised")
MODE: Final = _field("mode")
TILT: Final = _field("tilt")
GAIN: Final = _field("gain")
RANGE: Final = _field("range")
DATA_ACCEPT: Final = _field("data_accept")
SCAN_ANGLE: Final = _field("scan_angle")
SPARES: Final = tuple(f.SPARE_708.values())
UNKNOWN_LABEL: Final = f.UNUSUAL_708.index("unknown_label")
RESERVED_MODE: Final = f.UNUSUAL_708.index("reserved_mode")
FIRST_SPARE: Final = f.UNUSUAL_708.index(next(iter(f.SPARE_708)))
TILT_LSB_DEG: Final = f.TILT_LSB_DEG
SCAN_ANGLE_LSB_DEG: Final = f.SCAN_ANGLE_LSB_DEG
GAIN_LSB_DB: Final = f.GAIN_LSB_DB
GAIN_CALIBRATED: Final = f.GAIN_CALIBRATED
RANGE_LSB_NM: Final = float(f.RANGE_LSB_NM)
RANGE_CODE_ZERO_NM: Final = float(f.RANGE_CODE_ZERO_NM)
WORDS_AT_ONCE: Final = 2000  # headers that stay in the nearest cache while each field passes over them
PART_BITS: Final = 16  # A header is cut into 32 bits from bit 0, 16 and 32: every field lies within one of them,
PARTS: Final = 3  # and of numbers of 32 bits a register holds twice as many as of whole headers.


@njit(cache=True)
def headers(words: Bytes, meanings: Meanings, header: Header) -> None:
    """Fill the header fields of each word. One loop a field: the compiler makes vectors of such loops only."""
    low, middle, high = _room(), _room(), _room()
    for first in range(0, words.shape[0], WORDS_AT_ONCE):
        end = min(first + WORDS_AT_ONCE, words.shape[0])
        bits = low[: end - first], middle[: end - first], high[: end - first]
        unusual = header.unusual[first:end]
        _load(words[first:end], bits)
        _label(bits, header.label[first:end])
        _code(bits, CONTROL_ACCEPT, header.control_accept[first:end])
        _flag(bits, SLAVE, header.slave[first:end])
        _code(bits, ANNUNCIATIONS, header.annunciations[first:end])
        _code(bits, FAULTS, header.faults[first:end])
        _flag(bits, STABILISED, header.stabilised[first:end])
        _code(bits, MODE, header.mode[first:end])
        _angle(bits, TILT, 0, 1, TILT_LSB_DEG, header.tilt_deg[first:end])
        _gain(bits, header.gain_db[first:end])
        _range(bits, header.range_nm[first:end])
        _code(bits, DATA_ACCEPT, header.data_accept[first:end])
        zero, sense = meanings.scan_angle_zero, meanings.scan_angle_sense
        _angle(bits, SCAN_ANGLE, zero, sense, SCAN_ANGLE_LSB_DEG, header.scan_angle_deg[first:end])
        _unexpected(header.label[first:end], meanings.labels, UNKNOWN_LABEL, unusual)
        _reserved(header.mode[first:end], meanings.reserved_modes, RESERVED_MODE, unusual)
        _spares(bits, unusual)


@njit(cache=True)
def gain_db(code: Int) -> float:
    """0 is maximum gain, nan calibrated."""
    return np.nan if code == GAIN_CALIBRATED else np.int32(code) * GAIN_LSB_DB + 0.0  # so that 0 is not -0


@njit(cache=True)
def range_nm(code: Int) -> float:
    """5 to 320."""
    return RANGE_CODE_ZERO_NM if code == 0 else np.int32(code) * RANGE_LSB_NM


@njit(cache=True)
def _room() -> Array:
    return np.empty(WORDS_AT_ONCE, np.int32)


@njit(cache=True)
def _load(words: Bytes, bits: Parts) -> None:
    for i in range(words.shape[0]):
        header = np.int64(0)
        for place in range(HEADER_BYTES):
            header |= np.int64(words[i, place]) << (8 * place)
        for part in range(PARTS):
            bits[part][i] = header >> (PART_BITS * part)


@njit(cache=True)
def _place(bits: Parts, place: Place) -> tuple[Array, np.int32, np.int32]:
    """Where a field is: the part of the header it lies in, how far from its foot, and a mask of its width."""
    part = min(place[0] // PART_BITS, PARTS - 1)
    return bits[part], np.int32(place[0] - PART_BITS * part), np.int32((1 << place[1]) - 1)


@njit(cache=True)
def _code(bits: Parts, place: Place, codes: Array) -> None:
    part, shift, mask = _place(bits, place)
    for i in range(codes.size):
        codes[i] = (part[i] >> shift) & mask


@njit(cache=True)
def _flag(bits: Parts, place: Place, flags: Array) -> None:
    part, shift, mask = _place(bits, place)
    for i in range(flags.size):
        flags[i] = ((part[i] >> shift) & mask) != 0


@njit(cache=True)
def _gain(bits: Parts, values: Array) -> None:
    part, shift, mask = _place(bits, GAIN)
    for i in range(values.size):
        values[i] = gain_db((part[i] >> shift) & mask)


@njit(cache=True)
def _range(bits: Parts, values: Array) -> None:
    part, shift, mask = _place(bits, RANGE)
    for i in range(values.size):
        values[i] = range_nm((part[i] >> shift) & mask)


@njit(cache=True)
def _angle(bits: Parts, place: Place, zero: int, sense: int, lsb_deg: float, values: Array) -> None:
    part, shift, _ = _place(bits, place)
    first, sign, above = np.int32(zero), np.int32(sense), np.int32(32 - place[1])
    for i in range(values.size):
        code = np.int32(first + sign * (part[i] >> shift))
        values[i] = np.int32(np.int32(code << above) >> above) * lsb_deg  # the shift back up repeats the sign


@njit(cache=True)
def _label(bits: Parts, labels: Array) -> None:
    # The label alone is sent most significant bit first.
    part, shift, mask = _place(bits, LABEL)
    for i in range(labels.size):
        label = (part[i] >> shift) & mask
        label = (label & 0x0F) << 4 | label >> 4
        label = (label & 0x33) << 2 | (label >> 2) & 0x33
        labels[i] = (label & 0x55) << 1 | (label >> 1) & 0x55


@njit(cache=True)
def _unexpected(codes: Array, expected: Array, flag: int, unusual: Array) -> None:
    unusual[:] = 1 << flag
    for k in range(expected.size):
        code = expected[k]
        for i in range(codes.size):
            unusual[i] = np.uint8(unusual[i] * np.uint8(codes[i] != code))


@njit(cache=True)
def _reserved(codes: Array, reserved: Array, flag: int, unusual: Array) -> None:
    for k in range(reserved.size):
        code = reserved[k]
        for i in range(codes.size):
            unusual[i] = np.uint8(unusual[i] | np.uint8(codes[i] == code) << flag)


@njit(cache=True)
def _spares(bits: Parts, unusual: Array) -> None:
    part0, shift0, mask0 = _place(bits, SPARES[0])
    part1, shift1, mask1 = _place(bits, SPARES[1])
    part2, shift2, mask2 = _place(bits, SPARES[2])
    flag0, flag1, flag2 = np.int32(FIRST_SPARE), np.int32(FIRST_SPARE + 1), np.int32(FIRST_SPARE + 2)
    for i in range(unusual.size):
        flags = np.int32((part0[i] >> shift0) & mask0 != 0) << flag0
        flags |= np.int32((part1[i] >> shift1) & mask1 != 0) << flag1
        flags |= np.int32((part2[i] >> shift2) & mask2 != 0) << flag2
        unusual[i] |= flags
