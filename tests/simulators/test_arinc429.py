"""The ARINC 429 encoder against exact fractions and bit strings worked out here."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulators import utc
from simulators.arinc429 import encode, encode_array, encode_data, encode_position, without_data

ROWS = {  # label: (first bit, last bit, LSB, signed)
    0o076: (9, 29, Fraction(1, 8), True),
    0o103: (14, 29, Fraction(180, 2**15), True),
    0o112: (14, 29, Fraction(1, 8), True),
    0o130: (12, 28, Fraction(16, 2**17), False),
    0o140: (9, 28, Fraction(1, 2**20), False),
    0o164: (13, 29, Fraction(1, 8), True),
    0o310: (9, 29, Fraction(180, 2**20), True),
    0o314: (14, 29, Fraction(180, 2**15), True),
    0o324: (15, 29, Fraction(180, 2**14), True),
    0o361: (9, 29, Fraction(1, 8), True),
}


def bits(word: int) -> str:
    """The word as sent: bit 1 first."""
    return f"{word:032b}"[::-1]


def integer(word: int, first: int, last: int, signed: bool) -> int:
    field = bits(word)[first - 1 : last][::-1]
    return int(field, 2) - (2 ** len(field) if signed and field[0] == "1" else 0)


@given(st.sampled_from(sorted(ROWS)), st.data())
def test_a_value_comes_back_from_the_bits_within_half_a_step_and_ties_go_to_the_even_one(
    label: int, data: st.DataObject
) -> None:
    first, last, lsb, signed = ROWS[label]
    size = 2 ** (last - first + 1)
    quarters = data.draw(st.integers(-2 * size if signed else 0, (2 if signed else 4) * size - 4))
    value = quarters * lsb / 4  # exact in binary: every LSB is 45 or a power of two over a power of two
    word = encode(label, float(value))
    assert integer(word, first, last, signed) == round(value / lsb)
    assert bits(word)[:8] == f"{label:08b}"
    assert bits(word)[29:31] == "11"
    assert bits(word).count("1") % 2 == 1


@pytest.mark.parametrize(
    ("label", "value"),
    [(0o112, 4096.0), (0o140, -0.1), (0o130, 16.0), (0o361, -131073.0), (0o164, 8192.0), (0o361, float("nan"))],
)
def test_a_value_that_does_not_fit_is_refused_by_name(label: int, value: float) -> None:
    with pytest.raises(ValueError, match=f"label {label:03o}"):
        encode(label, value)


def test_angles_wrap_at_half_a_turn_instead_of_saturating() -> None:
    assert encode(0o314, 180.0) == encode(0o314, -180.0)
    assert encode(0o314, 190.0) == encode(0o314, -170.0)
    assert encode(0o313, 359.9999) == encode(0o313, 0.0)


@given(st.floats(-180, 179.9999999))
def test_coarse_and_fine_words_give_the_angle_with_the_fine_part_always_added(degrees: float) -> None:
    coarse, fine = (int(words[0]) for words in encode_position(0o111, 0o121, [degrees]))
    steps = integer(coarse, 9, 29, True) * 2048 + integer(fine, 18, 28, False)
    error = abs(Fraction(steps * 180, 2**31) - Fraction(degrees))
    assert min(error, 360 - error) <= Fraction(90, 2**31) * (1 + Fraction(1, 10**6))
    assert bits(fine)[28] == "0"


def test_an_array_gives_the_words_of_its_values_and_the_status_of_each() -> None:
    values = np.linspace(-170, 170, 41)
    words = encode_array(0o314, values, ssm=[3, 1] * 20 + [0])
    singles = [encode(0o314, value, ssm=ssm) for value, ssm in zip(values, [3, 1] * 20 + [0], strict=True)]
    assert words.tolist() == singles


def test_lost_data_keeps_the_label_and_odd_parity_and_nothing_else() -> None:
    word = int(without_data(encode_array(0o310, [44.4]), 1)[0])
    assert bits(word) == f"{0o310:08b}" + "0" * 21 + "10" + f"{(f'{0o310:08b}'.count('1')) % 2:d}"


def test_raw_data_and_the_source_identifier_stand_where_they_belong() -> None:
    word = encode(0o273, data=0b101 << 16, sdi=2)
    assert bits(word)[8:10] == "01"
    assert bits(word)[26:29] == "101"
    with pytest.raises(ValueError, match="273"):
        encode_data(0o273, [2**19])
    with pytest.raises(ValueError, match="either"):
        encode(0o273)


def test_a_label_with_two_meanings_asks_for_its_definition() -> None:
    with pytest.raises(ValueError, match="label 370"):
        encode(0o370, 1.0)


def test_date_and_time_of_the_last_second_before_the_century_year_are_digits_and_fields() -> None:
    instant = np.array(["2099-12-31T23:59:58.999999999"], "datetime64[ns]")
    date = int(utc.date_data(instant)[0])
    digits = [(date >> shift) & mask for shift, mask in ((17, 3), (13, 15), (12, 1), (8, 15), (4, 15), (0, 15))]
    assert digits == [3, 1, 1, 2, 9, 9]
    time = int(utc.time_data(instant)[0])
    assert [time >> 13 & 31, time >> 7 & 63, time >> 1 & 63, time & 1] == [23, 59, 58, 1]
    assert utc.fraction_s(instant)[0] == 1 - 2.0**-20
