"""Parts, values and statuses of ARINC 429 words, and one test for each way public decoders get them wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders.arinc429 import Status, decode, join_position, unpack
from decoders.definitions import Definitions, load_definitions
from tests.decoders.bus import word429

GNSS = load_definitions("gnss_743a")
IRU = load_definitions("iru_704")
ANY_WORDS = st.lists(st.integers(0, 2**32 - 1), max_size=20)


def one(word: int, definitions: Definitions) -> tuple[float, Status]:
    values = decode([word], definitions)
    return float(values.value[0]), Status(values.status[0])


def test_a_word_comes_apart_into_its_five_parts() -> None:
    word = word429(0o310, {9: (2, 2), 11: (0x5A5A5, 19)}, ssm=3)
    parts = unpack([word, word ^ 1 << 31])
    assert (parts.label[0], parts.sdi[0], parts.data[0], parts.ssm[0]) == (0o310, 2, 0x5A5A5, 3)
    assert parts.parity_ok.tolist() == [True, False]
    assert [part.dtype.str[1:] for part in parts] == ["u1", "u1", "u4", "u1", "b1"]


@pytest.mark.parametrize("label", range(256))
def test_a_label_reads_the_same_from_a_card_that_turns_it_round(label: int) -> None:
    wire = word429(label, {}, ssm=3)
    turned = wire & ~0xFF | label
    assert unpack([wire]).label[0] == unpack([turned], "label_swapped").label[0] == label
    assert unpack([turned], "label_swapped").parity_ok[0]


@given(ANY_WORDS)
def test_parity_is_an_odd_number_of_ones(words: list[int]) -> None:
    assert unpack(words).parity_ok.tolist() == [word.bit_count() % 2 == 1 for word in words]


@given(ANY_WORDS, st.sampled_from(["gnss_743", "iru_704", "adc_706", "ra_707"]))
def test_any_words_give_one_declared_status_each_and_no_value_unless_normal(words: list[int], name: str) -> None:
    values = decode(words, load_definitions(name))
    assert values.label.size == values.value.size == values.status.size == len(words)
    assert all(Status(status) in Status for status in values.status)
    assert not values.value[values.status != Status.NORMAL].any()
    assert np.isfinite(values.value).all()


def test_status_codes_keep_their_numbers() -> None:
    names = "NORMAL NO_COMPUTED_DATA FUNCTIONAL_TEST FAILURE_WARNING BAD_PARITY UNKNOWN_LABEL INVALID_DATA"
    assert [status.name for status in sorted(Status)] == names.split()
    assert sorted(Status) == list(range(7))


@pytest.mark.parametrize(
    ("label", "statuses"),
    [
        (0o310, [Status.FAILURE_WARNING, Status.NO_COMPUTED_DATA, Status.FUNCTIONAL_TEST, Status.NORMAL]),
        (0o270, [Status.NORMAL, Status.NO_COMPUTED_DATA, Status.FUNCTIONAL_TEST, Status.FAILURE_WARNING]),
    ],
)
def test_the_ssm_is_read_by_the_table_of_the_label(label: int, statuses: list[Status]) -> None:
    assert [one(word429(label, {}, ssm), IRU)[1] for ssm in range(4)] == statuses


def test_labels_150_and_162_use_the_bnr_table_and_343_the_discrete_one() -> None:
    assert one(word429(0o150, {}, ssm=3), GNSS)[1] == Status.NORMAL
    assert one(word429(0o150, {}, ssm=0), GNSS)[1] == Status.FAILURE_WARNING
    assert one(word429(0o162, {}, ssm=3), GNSS)[1] == Status.NORMAL
    assert one(word429(0o343, {}, ssm=0), GNSS)[1] == Status.NORMAL


def test_bad_parity_comes_before_an_unknown_label_and_that_before_the_ssm() -> None:
    assert one(word429(0o001, {}, ssm=1, odd=False), IRU)[1] == Status.BAD_PARITY
    assert one(word429(0o001, {}, ssm=1), IRU)[1] == Status.UNKNOWN_LABEL


def test_the_ssm_comes_before_invalid_data() -> None:
    hour_31 = {24: (31, 5)}
    assert one(word429(0o150, hour_31, ssm=1), GNSS)[1] == Status.NO_COMPUTED_DATA
    assert one(word429(0o150, hour_31, ssm=3), GNSS)[1] == Status.INVALID_DATA


def test_a_negative_bnr_is_not_read_as_large_and_positive() -> None:
    minus_one_lsb = word429(0o324, {15: (2**15 - 1, 15)}, ssm=3)
    assert one(minus_one_lsb, IRU) == (-180 / 2**14, Status.NORMAL)


def test_bad_parity_is_not_silently_repaired() -> None:
    assert one(word429(0o324, {15: (100, 15)}, ssm=3, odd=False), IRU) == (0.0, Status.BAD_PARITY)


@given(st.integers(-(2**20), 2**20 - 1))
def test_no_latitude_is_moved_by_a_decimal_floor(lsbs: int) -> None:
    word = word429(0o310, {9: (lsbs & 0x1FFFFF, 21)}, ssm=3)
    assert one(word, IRU)[0] * 2**20 / 180 == lsbs


def test_ssm_01_and_10_are_not_swapped() -> None:
    assert one(word429(0o310, {}, ssm=0b01), IRU)[1] == Status.NO_COMPUTED_DATA
    assert one(word429(0o310, {}, ssm=0b10), IRU)[1] == Status.FUNCTIONAL_TEST


def test_utc_fine_of_three_quarters_of_a_second_is_not_minus_one_quarter() -> None:
    assert one(word429(0o140, {9: (3 << 18, 20)}, ssm=3), GNSS)[0] == 0.75


def test_an_integrity_limit_of_12_nm_is_not_minus_4() -> None:
    assert one(word429(0o130, {12: (3 << 15, 17)}, ssm=3), GNSS)[0] == 12.0


def test_results_of_two_calls_share_no_memory() -> None:
    first = decode([word429(0o324, {15: (100, 15)}, ssm=3)], IRU)
    kept = first.value.copy()
    decode([word429(0o324, {15: (200, 15)}, ssm=3)], IRU)
    assert first.value == kept


def test_a_label_means_what_its_equipment_says() -> None:
    word = word429(0o370, {14: (4096, 15)}, ssm=3)
    assert one(word, IRU)[0] == 1.0
    assert one(word, GNSS)[0] == 4096 * 32 * 0.125
    # 165: vertical velocity from a GNSS, BCD height from a radio altimeter.
    assert one(word429(0o165, {11: (0x12345, 19)}, ssm=0), load_definitions("ra_707"))[0] == 1234.5
    assert one(word429(0o165, {14: (5, 15)}, ssm=3), GNSS)[0] == 5.0


def test_a_vertical_figure_of_merit_is_metres_in_743_and_feet_in_743a() -> None:
    word = word429(0o136, {14: (32, 15)}, ssm=3)
    assert one(word, load_definitions("gnss_743"))[0] == 1.0
    assert one(word, GNSS)[0] == 32.0


def test_bcd_takes_its_sign_from_the_ssm() -> None:
    radio = load_definitions("ra_707")
    assert one(word429(0o165, {11: (0x00205, 19)}, ssm=3), radio) == (-20.5, Status.NORMAL)
    assert np.signbit(decode([word429(0o165, {}, ssm=3)], radio).value[0]) == np.False_


@pytest.mark.parametrize("first_bit", [11, 15, 19, 23])
def test_a_bcd_digit_above_nine_is_invalid(first_bit: int) -> None:
    assert one(word429(0o165, {first_bit: (10, 4)}, ssm=3), load_definitions("ra_707")) == (0.0, Status.INVALID_DATA)


@pytest.mark.parametrize(
    ("hours", "minutes", "seconds", "expected"),
    [(0, 0, 0, (0.0, Status.NORMAL)), (12, 34, 56, (45296.0, Status.NORMAL)), (23, 59, 59, (86399.0, Status.NORMAL))]
    + [(23, 59, 60, (86400.0, Status.NORMAL))]  # a leap second
    + [
        (h, m, s, (0.0, Status.INVALID_DATA))
        for h, m, s in [(24, 0, 0), (0, 60, 0), (0, 0, 60), (22, 59, 60), (23, 59, 61), (31, 63, 63)]
    ],
)
def test_utc_is_seconds_of_the_day_or_invalid(
    hours: int, minutes: int, seconds: int, expected: tuple[float, Status]
) -> None:
    fields = {24: (hours, 5), 18: (minutes, 6), 12: (seconds, 6)}
    assert one(word429(0o150, fields, ssm=3), GNSS) == expected
    assert one(word429(0o150, {**fields, 11: (1, 1)}, ssm=3), GNSS) == expected  # the precision bit is no part of it


def date_word(day: int, month: int, year: int) -> int:
    digits = {28: (day // 10, 2), 24: (day % 10, 4), 23: (month // 10, 1), 19: (month % 10, 4)}
    return word429(0o260, {**digits, 15: (year // 10, 4), 11: (year % 10, 4)})


def test_every_day_of_the_century_is_the_calendars() -> None:
    days = np.arange(np.datetime64("2000-01-01"), np.datetime64("2100-01-01"))
    words = [date_word(d.day, d.month, d.year - 2000) for d in days.tolist()]
    values = decode(words, GNSS)
    assert not values.status.any()
    np.testing.assert_array_equal(values.value, np.arange(days.size))


@pytest.mark.parametrize("date", [(0, 1, 0), (32, 1, 0), (29, 2, 1), (30, 2, 0), (31, 4, 9), (1, 0, 5), (1, 13, 5)])
def test_a_date_that_does_not_exist_is_invalid(date: tuple[int, int, int]) -> None:
    assert one(date_word(*date), GNSS) == (0.0, Status.INVALID_DATA)


@pytest.mark.parametrize("first_bit", [11, 15, 19, 24])
def test_a_date_with_a_digit_above_nine_is_invalid(first_bit: int) -> None:
    digits = {24: (1, 4), 19: (1, 4), first_bit: (10, 4)}
    assert one(word429(0o260, digits), GNSS)[1] == Status.INVALID_DATA


@given(st.integers(-(2**31), 2**31 - 1))
def test_a_joined_position_is_the_32_bit_angle_it_was_cut_from(angle: int) -> None:
    coarse = word429(0o110, {9: (angle >> 11 & 0x1FFFFF, 21)}, ssm=3)
    fine = word429(0o120, {18: (angle & 0x7FF, 11)}, ssm=3)
    assert join_position([coarse], [fine]).tolist() == [angle * 180 / 2**31]


def test_a_fine_word_is_added_in_the_south_too_unless_the_port_says_otherwise() -> None:
    coarse, fine = word429(0o110, {9: (-1 & 0x1FFFFF, 21)}, ssm=3), word429(0o120, {18: (2047, 11)}, ssm=3)
    assert join_position([coarse], [fine]) == -180 / 2**31
    assert join_position([coarse], [fine], "toward_zero") == -(2048 + 2047) * 180 / 2**31


def test_a_fine_word_is_added_in_the_north_whatever_the_rule() -> None:
    coarse, fine = word429(0o110, {9: (1, 21)}, ssm=3), word429(0o120, {18: (2047, 11)}, ssm=3)
    assert join_position([coarse], [fine]) == join_position([coarse], [fine], "toward_zero") == 4095 * 180 / 2**31


def test_a_fine_word_is_never_negative_and_its_bit_29_is_no_data() -> None:
    fine = word429(0o120, {18: (2047, 11), 29: (1, 1)}, ssm=3)
    assert join_position([word429(0o110, {}, ssm=3)], [fine]) == 2047 * 180 / 2**31
    assert one(fine, GNSS)[0] == 2047 * 180 / 2**31


def test_words_of_a_wrong_kind_are_refused() -> None:
    for words in ([1.5], [[1, 2]], 7, [-1], [2**32]):
        with pytest.raises(ValueError, match="32-bit unsigned integers"):
            unpack(words)
    with pytest.raises(ValueError, match="label_swapped"):
        decode([1], IRU, "swapped")
    with pytest.raises(ValueError, match="toward_zero"):
        join_position([1], [1], "floor")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="2 coarse and 1 fine"):
        join_position([1, 2], [1])


def test_strided_read_only_and_wider_words_decode_alike() -> None:
    words = np.array([word429(0o324, {15: (n, 15)}, ssm=3) for n in range(8)], np.uint32)
    strided = np.repeat(words, 2)[::2]
    frozen = np.frombuffer(b"\0" + words.tobytes(), np.uint32, offset=1)
    expected = decode(words, IRU).value.tolist()
    for form in (strided, frozen, words.astype(np.int64), words.astype(">u4"), words.tolist()):
        assert decode(form, IRU).value.tolist() == expected


def test_no_words_are_no_values() -> None:
    assert decode([], IRU).value.size == unpack([]).label.size == join_position([], []).size == 0
