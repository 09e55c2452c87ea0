"""The loops over ARINC 429 words, compiled; `decoders.arinc429` says what they do and checks their arguments.

Numba freezes module constants into its cache, so what may change between runs (labels, SSM tables) comes as arrays.
"""

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from decoders.definition_rows import CHARACTER_BITS
from decoders.formats import CLOCK_DIGITS, DATE_DIGITS, SSM_BCD_MINUS, TIME_FIELDS
from decoders.results429 import Status

Int = int | np.int64

UNDEFINED: Final = 0
SIGNED: Final = 1
UNSIGNED: Final = 2
BCD: Final = 3
TIME: Final = 4
DATE: Final = 5
CLOCK: Final = 6
TEXT: Final = 7

# Columns of the label table; the value is integer * numerator / denominator.
ENCODING: Final = 0
FIRST: Final = 1  # bit
WIDTH: Final = 2  # with the sign
SSM_SIGN: Final = 3  # whether SSM 11 is minus
NUMERATOR: Final = 4
DENOMINATOR: Final = 5
SSM_STATUS: Final = 6  # and three more: the status that SSM 00, 01, 10 and 11 give
COLUMNS: Final = 10

INVALID: Final = -(2**62)  # no field of a word is that small
NORMAL: Final = int(Status.NORMAL)
BAD_PARITY: Final = int(Status.BAD_PARITY)
UNKNOWN_LABEL: Final = int(Status.UNKNOWN_LABEL)
INVALID_DATA: Final = int(Status.INVALID_DATA)

TIME_LIMITS: Final = tuple(TIME_FIELDS.values())
DATE_PARTS: Final = tuple(DATE_DIGITS.values())
CLOCK_PARTS: Final = tuple(CLOCK_DIGITS.values())
LEAP_SECOND: Final = 60
DAY_S: Final = 86_400
MONTH_DAYS: Final = (31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)


@njit(cache=True)
def unpack(
    words: npt.NDArray[np.uint32],
    swapped: bool,
    label: npt.NDArray[np.uint8],
    sdi: npt.NDArray[np.uint8],
    data: npt.NDArray[np.uint32],
    ssm: npt.NDArray[np.uint8],
    parity_ok: npt.NDArray[np.bool_],
) -> None:
    """Fill the parts of each word."""
    for i in range(words.size):
        word = np.int64(words[i])
        label[i] = _label(word, swapped)
        sdi[i] = _bits(word, 9, 2)
        data[i] = _bits(word, 11, 19)
        ssm[i] = _bits(word, 30, 2)
        parity_ok[i] = _odd(word)


@njit(cache=True)
def decode(
    words: npt.NDArray[np.uint32],
    swapped: bool,
    table: npt.NDArray[np.int64],
    label: npt.NDArray[np.uint8],
    value: npt.NDArray[np.float64],
    status: npt.NDArray[np.uint8],
) -> None:
    """Fill label, value and status of each word; a row of `table` is a label's definition in the columns above."""
    for i in range(words.size):
        word = np.int64(words[i])
        label[i] = _label(word, swapped)
        row = table[label[i]]
        integer = _integer(word, row)
        status[i] = _status(word, row, integer)
        value[i] = integer * row[NUMERATOR] / row[DENOMINATOR] if status[i] == NORMAL else 0.0


@njit(cache=True)
def join_positions(
    coarse: npt.NDArray[np.uint32], fine: npt.NDArray[np.uint32], toward_zero: bool, degrees: npt.NDArray[np.float64]
) -> None:
    """Fill degrees of pairs of words."""
    for i in range(coarse.size):
        degrees[i] = join_position(coarse[i], fine[i], toward_zero)


@njit(cache=True)
def join_position(coarse: Int, fine: Int, toward_zero: bool) -> float:
    """Degrees: 21 bits of two's complement (bits 9-29), then 11 bits of remainder (bits 18-28)."""
    high = _signed(_bits(np.int64(coarse), 9, 21), 21)
    low = _bits(np.int64(fine), 18, 11)
    if toward_zero and high < 0:
        low = -low
    return float((high * 2048 + low) * (180 / 2**31))


@njit(cache=True)
def _bits(word: Int, first: Int, width: Int) -> Int:
    return (word >> (first - 1)) & ((1 << width) - 1)


@njit(cache=True)
def _label(word: Int, swapped: bool) -> Int:
    label = word & 0xFF
    if swapped:
        return label
    label = (label & 0x0F) << 4 | label >> 4
    label = (label & 0x33) << 2 | (label >> 2) & 0x33
    return (label & 0x55) << 1 | (label >> 1) & 0x55


@njit(cache=True)
def _odd(word: Int) -> bool:
    word ^= word >> 16
    word ^= word >> 8
    word ^= word >> 4
    # 0x6996 holds the parity of each of 16 nibbles.
    return (0x6996 >> (word & 0xF)) & 1 == 1


@njit(cache=True)
def _status(word: Int, row: npt.NDArray[np.int64], integer: Int) -> Int:
    if not _odd(word):
        return BAD_PARITY
    if row[ENCODING] == UNDEFINED:
        return UNKNOWN_LABEL
    status = int(row[SSM_STATUS + _bits(word, 30, 2)])
    if status == NORMAL and integer == INVALID:
        return INVALID_DATA
    return status


@njit(cache=True)
def _integer(word: Int, row: npt.NDArray[np.int64]) -> Int:
    """The word's value in LSBs, INVALID if it has none."""
    encoding = row[ENCODING]
    raw = _bits(word, row[FIRST], row[WIDTH])
    if encoding == SIGNED:
        return _signed(raw, row[WIDTH])
    if encoding == BCD:
        magnitude = _decimal(raw)
        minus = row[SSM_SIGN] and _bits(word, 30, 2) == SSM_BCD_MINUS
        return -magnitude if minus and magnitude != INVALID else magnitude
    return raw if encoding == UNSIGNED else _composed(word, encoding, raw)


@njit(cache=True)
def _composed(word: Int, encoding: Int, raw: Int) -> Int:
    """The value of a word whose data are several numbers or characters."""
    if encoding == TIME:
        return _seconds(word)
    if encoding == DATE:
        return _days(word)
    if encoding == CLOCK:
        return _tenths(word)
    return _characters(raw) if encoding == TEXT else raw


@njit(cache=True)
def _signed(raw: Int, width: Int) -> Int:
    return raw - ((raw >> (width - 1)) << width)


@njit(cache=True)
def _decimal(raw: Int) -> Int:
    total: Int = 0
    place = 1
    while raw:
        digit = raw & 0xF
        if digit > 9:
            return INVALID
        total += digit * place
        place *= 10
        raw >>= 4
    return total


@njit(cache=True)
def _seconds(word: Int) -> Int:
    total: Int = 0
    part: Int = 0
    for first, width, largest in TIME_LIMITS:
        part = _bits(word, first, width)
        if part > largest:
            return INVALID
        total = total * 60 + part
    return INVALID if part == LEAP_SECOND and total != DAY_S else total


@njit(cache=True)
def _digits(word: Int, places: tuple[tuple[int, int], ...]) -> Int:
    """The decimal number of BCD digits that do not lie nibble by nibble."""
    number: Int = 0
    for first, width in places:
        digit = _bits(word, first, width)
        if digit > 9:
            return INVALID
        number = number * 10 + digit
    return number


@njit(cache=True)
def _days(word: Int) -> Int:
    """Days since 2000-01-01, years 2000 to 2099, in which each fourth is a leap year."""
    number = _digits(word, DATE_PARTS)
    day, month, year = number // 10000, number // 100 % 100, number % 100
    leap = year % 4 == 0
    if number == INVALID or not 1 <= month <= 12:
        return INVALID
    if not 1 <= day <= MONTH_DAYS[month - 1] + (leap and month == 2):
        return INVALID
    days = 365 * year + (year + 3) // 4 + day - 1 + (leap and month > 2)
    for earlier in range(month - 1):
        days += MONTH_DAYS[earlier]
    return days


@njit(cache=True)
def _tenths(word: Int) -> Int:
    """Tenths of a minute since midnight."""
    number = _digits(word, CLOCK_PARTS)
    hours, tenths = number // 1000, number % 1000
    if number == INVALID or hours > 23 or tenths > 599:
        return INVALID
    return hours * 600 + tenths


@njit(cache=True)
def _characters(raw: Int) -> Int:
    """The bits as they are, if every character can be printed or is the filler 0."""
    rest = raw
    while rest:
        character = rest & ((1 << CHARACTER_BITS) - 1)
        if character and not 0x20 <= character <= 0x7E:
            return INVALID
        rest >>= CHARACTER_BITS
    return raw
