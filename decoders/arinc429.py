"""ARINC 429 words to engineering values: a word's parts, its value by a label set, and positions joined from two words.

A word is 32 bits with bit 1 (first on the wire) as the least significant. The label's most significant bit is bit 1, so
the low byte is the label reversed: orientation "wire". Cards that turn the label round deliver "label_swapped".
Bad words are a status beside the value; only wrong use raises.
"""

from functools import cache
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from decoders import kernels429
from decoders.definition_rows import CHARACTER_BITS
from decoders.definitions import Definition, Definitions, load_definitions
from decoders.formats import ORIENTATIONS, SSM_TABLES
from decoders.results429 import Status, Values429, Words429

__all__ = ["Status", "Values429", "Words429", "decode", "field", "join_position", "load_definitions", "text", "unpack"]

JoinRule = Literal["concatenate", "toward_zero"]
TOWARD_ZERO: Final = "toward_zero"
JOIN_RULES: Final = ("concatenate", TOWARD_ZERO)


ENCODING_CODES: Final = {
    "bnr": kernels429.SIGNED,
    "bnr_unsigned": kernels429.UNSIGNED,
    "disc": kernels429.UNSIGNED,
    "bcd": kernels429.BCD,
    "time": kernels429.TIME,
    "date": kernels429.DATE,
    "clock": kernels429.CLOCK,
    "iso5": kernels429.TEXT,
}


def unpack(words: npt.ArrayLike, orientation: str = "wire") -> Words429:
    """The parts of words (n,) u4 (ARINC 429 word format). Labels are conventional: octal 310 is 0o310.

    Raises ValueError for words that are no row of 32-bit unsigned integers, or an unknown orientation.
    """
    array = _words(words)
    n = array.size
    parts = Words429(
        label=np.empty(n, np.uint8),
        sdi=np.empty(n, np.uint8),
        data=np.empty(n, np.uint32),
        ssm=np.empty(n, np.uint8),
        parity_ok=np.empty(n, np.bool_),
    )
    kernels429.unpack(array, _swapped(orientation), *parts)
    return parts


def decode(words: npt.ArrayLike, definitions: Definitions, orientation: str = "wire") -> Values429:
    """The values of words (n,) u4 by a set of label definitions; a word is never repaired, and never left out.

    "bnr" is two's complement; "bcd" takes its sign from the SSM; "disc" is its bits as an integer; "time" (label 150)
    is seconds of the day, 86400 in a leap second; "clock" (label 125) minutes of the day; "date" (label 260) days since
    2000-01-01; "iso5" its characters as an integer. BCD digits above 9, times after 23:59:60, dates that do not exist
    and characters that cannot be printed are INVALID_DATA. A value is integer x LSB rounded once, so exact for every
    binary LSB.

    Raises ValueError for words that are no row of 32-bit unsigned integers, or an unknown orientation.
    """
    array = _words(words)
    n = array.size
    values = Values429(np.empty(n, np.uint8), np.empty(n), np.empty(n, np.uint8))
    kernels429.decode(array, _swapped(orientation), _table(definitions), *values)
    return values


def join_position(
    coarse: npt.ArrayLike, fine: npt.ArrayLike, rule: JoinRule = "concatenate"
) -> npt.NDArray[np.float64]:
    """Degrees (n,) from raw words (n,) u4 of 110 and 120, 111 and 121, 254 and 256, or 255 and 257.

    The fine word is an unsigned remainder (bits 18-28). "concatenate" always adds it, south and west too;
    "toward_zero" subtracts it there, for boxes that cut the coarse word toward zero. Status is not looked at: pair
    only words of one navigation epoch that `decode` calls normal.

    Raises ValueError for unequal lengths, words that are no 32-bit unsigned integers, or an unknown rule.
    """
    if rule not in JOIN_RULES:
        raise ValueError(f"unknown rule {rule!r}: use one of {', '.join(JOIN_RULES)}")
    coarse_words, fine_words = _words(coarse), _words(fine)
    if coarse_words.size != fine_words.size:
        raise ValueError(
            f"{coarse_words.size} coarse and {fine_words.size} fine words: pass one fine word to each coarse"
        )
    degrees = np.empty(coarse_words.size)
    kernels429.join_positions(coarse_words, fine_words, rule == TOWARD_ZERO, degrees)
    return degrees


def field(words: npt.ArrayLike, definition: Definition, name: str) -> npt.NDArray[np.uint32]:
    """The discrete bits `name` of a label's definition, u4 (n,), from raw words (n,) u4 of that label.

    Status is not looked at. Raises KeyError for a field that the definition does not have.
    """
    first, last = definition.fields[name]
    return _words(words) >> np.uint32(first - 1) & np.uint32((1 << last - first + 1) - 1)


def text(words: npt.ArrayLike, definition: Definition) -> list[str]:
    """What each of the raw words (n,) u4 of an "iso5" label says, fillers left out; status is not looked at."""
    first, last = definition.bits
    shifts = range(first - 1, last, CHARACTER_BITS)
    mask = (1 << CHARACTER_BITS) - 1
    return ["".join(chr(word >> shift & mask) for shift in shifts).replace("\0", "") for word in _words(words).tolist()]


def _words(words: npt.ArrayLike) -> npt.NDArray[np.uint32]:
    array = np.asarray(words)
    if array.ndim == 1 and array.dtype == np.uint32 and array.flags.carray:  # as they come from a bus, live
        return array
    if array.ndim != 1 or (array.size and array.dtype.kind not in "ui"):
        raise ValueError(f"words of shape {array.shape} and type {array.dtype}: pass a row of 32-bit unsigned integers")
    if array.dtype != np.uint32 and array.size and not 0 <= int(array.min()) <= int(array.max()) < 2**32:
        raise ValueError("a word outside 0 to 0xffffffff: pass 32-bit unsigned integers")
    # One memory layout, so that the kernels are compiled once.
    return np.require(array, np.uint32, ["C", "A", "W"])


def _swapped(orientation: str) -> bool:
    if orientation not in ORIENTATIONS:
        raise ValueError(f"unknown orientation {orientation!r}: use one of {', '.join(ORIENTATIONS)}")
    return orientation == "label_swapped"


@cache
def _table(definitions: Definitions) -> npt.NDArray[np.int64]:
    """The set as a table (256, 10) i8 that the kernel gathers from; a label without a definition is a row of zeros."""
    table = np.zeros((256, kernels429.COLUMNS), np.int64)
    for label, definition in definitions.labels.items():
        table[label] = _row(definition)
    return table


def _row(definition: Definition) -> tuple[int, ...]:
    first, last = definition.bits
    sign_bits = 1 if definition.encoding == "bnr" else 0
    return (
        ENCODING_CODES[definition.encoding],
        first,
        last - first + 1 + sign_bits,
        int(definition.encoding == "bcd" and definition.ssm == "bcd"),
        definition.lsb.numerator,
        definition.lsb.denominator,
        *(Status[name] for name in SSM_TABLES[definition.ssm]),
    )
