"""Encode ARINC 429 words: bit 1 is the least significant bit of the integer, so label bits come out reversed.

Only the label rows are shared with the decoders; the arithmetic is written from the characteristic's bit tables
without sight of theirs, so that the two check each other.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decoders.definitions import Definition
from simulators.labels import DEFINITIONS, SETS

BNR_NORMAL = 0b11
NO_COMPUTED_DATA = 0b01
FAILURE_WARNING = 0b00
DISCRETE_NORMAL = 0b00
FINE_STEPS = 2**11
SEMICIRCLE_STEPS = 2**31

Words = NDArray[np.uint32]
Steps = NDArray[np.int64]


def encode(
    label: int,
    value: float | None = None,
    *,
    data: int | None = None,
    definition: Definition | None = None,
    ssm: int | None = None,
    sdi: int = 0,
) -> int:
    """One word from a `value` in the label's units, or from the 19 raw `data` bits 11 to 29.

    `definition` replaces the built-in row. `ssm` is normal operation when left out: 3 for a binary value, 0 for raw
    data (BCD and discretes). Raises ValueError as `encode_array` and `encode_data` do.
    """
    if value is not None and data is None:
        normal = BNR_NORMAL if ssm is None else ssm
        return int(encode_array(label, [value], definition=definition, ssm=normal, sdi=sdi)[0])
    if data is not None and value is None:
        return int(encode_data(label, [data], ssm=DISCRETE_NORMAL if ssm is None else ssm, sdi=sdi)[0])
    raise ValueError(f"label {label:03o}: give either a value or the raw data bits")


def encode_array(
    label: int,
    values: ArrayLike,
    *,
    definition: Definition | None = None,
    ssm: ArrayLike = BNR_NORMAL,
    sdi: int = 0,
) -> Words:
    """Words (n,) from values (n,) in the label's units, rounded half to even to its least significant bit.

    Angles of +-180 degrees wrap. Raises ValueError for a label without a binary row and for a value out of range.
    """
    row = definition or _row_of(label)
    steps = np.rint(np.asarray(values, np.float64) / float(row.lsb))
    if not _is_circle(row):
        _check_range(row, steps)
    return _assemble(label, _place(row, steps.astype(np.int64)), ssm, sdi)


def encode_data(label: int, data: ArrayLike, *, ssm: ArrayLike = DISCRETE_NORMAL, sdi: int = 0) -> Words:
    """Words (n,) from the raw bits 11 to 29, given as integers (n,). Raises ValueError beyond 19 bits."""
    bits = np.asarray(data, np.int64)
    if np.any((bits < 0) | (bits >= 2**19)):
        raise ValueError(f"label {label:03o}: raw data take bits 11 to 29, so 0 to {2**19 - 1}")
    return _assemble(label, bits << 10, ssm, sdi)


def encode_position(
    coarse_label: int, fine_label: int, degrees: ArrayLike, *, ssm: ArrayLike = BNR_NORMAL
) -> tuple[Words, Words]:
    """Coarse and fine words (n,) of an angle (n,); the fine word is the unsigned remainder, south and west too."""
    steps = np.rint(np.asarray(degrees, np.float64) * (SEMICIRCLE_STEPS / 180)).astype(np.int64)
    coarse, fine = np.divmod(steps, FINE_STEPS)
    return (
        _assemble(coarse_label, _place(_row_of(coarse_label), coarse), ssm, 0),
        _assemble(fine_label, _place(_row_of(fine_label), fine), ssm, 0),
    )


def without_data(words: Words, ssm: int) -> Words:
    """The same labels with cleared data and another sign/status matrix, as from a source that has lost its data."""
    return _finish((words & np.uint32(0xFF)).astype(np.int64), np.asarray(ssm, np.int64))


def _row_of(label: int) -> Definition:
    row = DEFINITIONS.get(label)
    if row is None or row.encoding not in {"bnr", "bnr_unsigned"}:
        raise ValueError(f"label {label:03o} has no one binary meaning in {', '.join(SETS)}: give definition= or data=")
    return row


def _is_circle(row: Definition) -> bool:
    return row.encoding == "bnr" and row.units == "deg" and row.range == 180


def _width(row: Definition) -> int:
    """Bits of the value; a signed row has its sign in bit 29, above the bits that it states."""
    first, last = row.bits
    return last - first + 1 + (row.encoding == "bnr")


def _check_range(row: Definition, steps: NDArray[np.float64]) -> None:
    lowest = -(2 ** (_width(row) - 1)) if row.encoding == "bnr" else 0
    highest = lowest + 2 ** _width(row) - 1
    wrong = ~((steps >= lowest) & (steps <= highest))  # written so that NaN is wrong too
    if wrong.any():
        value, least, most = (float(number * float(row.lsb)) for number in (steps[wrong][0], lowest, highest))
        raise ValueError(f"label {row.label:03o}: {value} {row.units} is outside {least} to {most}: send it as no data")


def _place(row: Definition, steps: Steps) -> Steps:
    """Two's complement of the row's width, moved to its place."""
    return np.asarray((steps & (2 ** _width(row) - 1)) << (row.bits[0] - 1), np.int64)


def _assemble(label: int, placed: Steps, ssm: ArrayLike, sdi: int) -> Words:
    if not 0 <= label <= 0o377:
        raise ValueError(f"label {label:o} does not fit in eight bits: labels run from 000 to 377 octal")
    reversed_label = int(f"{label:08b}"[::-1], 2)
    return _finish(placed | reversed_label | sdi << 8, np.asarray(ssm, np.int64))


def _finish(body: Steps, ssm: Steps) -> Words:
    """Add the sign/status matrix (bits 30-31) and the odd parity (bit 32)."""
    words = body | ssm << 29
    even = (np.bitwise_count(words) & 1) == 0
    return np.asarray(words | even.astype(np.int64) << 31, np.uint32)
