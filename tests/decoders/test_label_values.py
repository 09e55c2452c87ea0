"""Golden values for every row of every label set, worked out in fractions apart from the decoder."""

from fractions import Fraction

import pytest

from decoders.arinc429 import Status, decode
from decoders.definitions import Definition, load_definitions
from tests.decoders.bus import NORMAL_SSM, word429

SETS = ["gnss_743", "gnss_743a", "iru_704", "adiru_738", "adc_706", "ra_707", "wxr_panel", "wxr_panel_divided_range"]
ROWS = [(name, row) for name in SETS for row in load_definitions(name).labels.values()]
BINARY_ROWS = [(name, row) for name, row in ROWS if row.encoding in ("bnr", "bnr_unsigned", "disc")]


def row_id(part: str | Definition) -> str:
    return part if isinstance(part, str) else f"{part.label:03o}"


def integers(row: Definition) -> list[int]:
    """0, +-1, smallest, largest, and each end with only its top bit."""
    width = row.bits[1] - row.bits[0] + 1
    if row.encoding == "bnr":
        return [0, 1, -1, 2 ** (width - 1), 2**width - 1, -(2**width), 1 - 2**width]
    return [0, 1, 2 ** (width - 1), 2**width - 1]


def value_of(row: Definition, integer: int) -> Fraction:
    # LSB = range / 2^n over n significant bits, sign not counted; a discrete is its bits.
    width = row.bits[1] - row.bits[0] + 1
    return Fraction(integer) if row.range is None else integer * row.range / 2**width


@pytest.mark.parametrize(("name", "row"), BINARY_ROWS, ids=row_id)
def test_binary_values_are_exact(name: str, row: Definition) -> None:
    size = row.bits[1] - row.bits[0] + 1 + (row.encoding == "bnr")
    numbers = integers(row)
    words = [word429(row.label, {row.bits[0]: (number % 2**size, size)}, NORMAL_SSM[row.ssm]) for number in numbers]
    values = decode(words, load_definitions(name))
    assert values.status.tolist() == [Status.NORMAL] * len(numbers)
    assert values.label.tolist() == [row.label] * len(numbers)
    assert values.value.tolist() == [float(value_of(row, number)) for number in numbers]


@pytest.mark.parametrize(("name", "row"), ROWS, ids=row_id)
def test_bits_beside_the_value_do_not_leak_into_it(name: str, row: Definition) -> None:
    first, last = row.bits
    beside = dict.fromkeys(range(9, first), (1, 1)) | dict.fromkeys(range(last + 1, 30), (1, 1))
    if row.encoding == "bnr":
        del beside[29]
    if row.encoding == "date":
        beside = {9: (3, 2), 19: (1, 4), 24: (1, 4)}  # 1 January; the rest of the word is its value
    values = decode([word429(row.label, beside, NORMAL_SSM[row.ssm])], load_definitions(name))
    assert (values.value[0], values.status[0]) == (0.0, Status.NORMAL)


def test_bcd_values_are_the_decimal_number_rounded_once() -> None:
    numbers = [0, 1, 3, 7, 99, 12345, 79999]
    words = [word429(0o165, {11: (int(str(number), 16), 19)}) for number in numbers]
    values = decode(words, load_definitions("ra_707"))
    assert values.value.tolist() == [float(Fraction(number, 10)) for number in numbers]


def test_mach_is_the_decimal_number_rounded_once_although_its_lsb_has_no_exact_float() -> None:
    words = [word429(0o205, {13: (number, 17)}, ssm=3) for number in range(65536)]
    values = decode(words, load_definitions("adc_706"))
    assert values.value.tolist() == [number * 625 / 10**7 for number in range(65536)]
