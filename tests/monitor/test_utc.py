"""UTC of the receiver, in the order of a real set and of every other, and around every seam of the calendar."""

from datetime import UTC, datetime, timedelta
from fractions import Fraction
from itertools import permutations

import pytest

from decoders.arinc429 import decode, load_definitions
from monitor.utc import UtcClock
from tests.decoders.bus import word429

GNSS = load_definitions("gnss_743a")
MS = 1_000_000
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def date(day: datetime) -> int:
    digits = {28: (day.day // 10, 2), 24: (day.day % 10, 4), 23: (day.month // 10, 1), 19: (day.month % 10, 4)}
    return word429(0o260, {**digits, 15: (day.year % 100 // 10, 4), 11: (day.year % 10, 4)})


def time(hours: int, minutes: int, seconds: int, precise: bool = True, ssm: int = 3) -> int:
    return word429(0o150, {24: (hours, 5), 18: (minutes, 6), 12: (seconds, 6), 11: (int(precise), 1)}, ssm)


def fraction(seconds: Fraction) -> tuple[int, int]:
    coarse, rest = divmod(seconds * 2**20, 1)
    return word429(0o140, {9: (int(coarse), 20)}, 3), word429(0o141, {19: (int(rest * 2**10), 10)}, 3)


def whole(moment: datetime) -> list[int]:
    return [
        date(moment),
        time(moment.hour, moment.minute, moment.second),
        *fraction(Fraction(moment.microsecond, 10**6)),
    ]


def feed(clock: UtcClock, time_ms: int, words: list[int]) -> None:
    """The words of a set, one a millisecond."""
    for k, word in enumerate(words):
        values = decode([word], GNSS)
        clock.feed((time_ms + k) * MS, word, values, 0, GNSS)


def utc_ns(moment: datetime) -> int:
    return (moment - EPOCH) // timedelta(microseconds=1) * 1000


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_a_set_in_any_order_gives_its_instant_to_the_nanosecond(order: tuple[int, ...]) -> None:
    moment = datetime(2026, 6, 1, 12, 34, 56, 750_000, UTC)
    clock, words = UtcClock(), whole(moment)
    feed(clock, 0, [date(moment)])
    feed(clock, 5000, [date(moment)])
    feed(clock, 5001, [words[k] for k in order])
    at = clock.at((5001 + order.index(1)) * MS)  # when the time of day was sent
    assert at.validity == "NORMAL"
    assert at.utc_ns is not None
    assert abs(at.utc_ns - utc_ns(moment)) <= 1


def test_three_quarters_of_a_second_are_added_and_never_taken_away() -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 0, 0, 1, 750_000, UTC)
    feed(clock, 0, whole(moment))
    at = clock.at(1 * MS)
    assert at.utc_ns is not None
    assert at.utc_ns % 10**9 == pytest.approx(750_000_000, abs=1)


def test_without_fractions_the_time_of_day_is_enough() -> None:
    """That there are none is known once a second time of day has come."""
    clock, moment = UtcClock(), datetime(2026, 6, 1, 7, 8, 9, tzinfo=UTC)
    feed(clock, 0, whole(moment)[:2])
    assert clock.at(1 * MS) == (None, "MISSING")
    feed(clock, 1000, whole(moment + timedelta(seconds=1))[:2])
    assert clock.at(1 * MS) == (utc_ns(moment), "NORMAL")


@pytest.mark.parametrize("order", list(permutations(range(4))))
@pytest.mark.parametrize("lost", [[], [2], [3], [2, 3]])
def test_no_set_is_whole_without_the_fractions_that_the_receiver_gives(order: tuple[int, ...], lost: list[int]) -> None:
    """One is damaged, or says it is not to be used: until the next whole set UTC runs on from the one before."""
    clock, first = UtcClock(), datetime(2026, 6, 1, 12, 34, 56, 250_000, UTC)
    for number in range(2):
        feed(clock, 200 * number, whole(first + timedelta(milliseconds=200 * number)))
    ahead_ns = utc_ns(first) - 1 * MS  # in a set of the order of whole() the time of day is sent after a millisecond
    words = whole(first + timedelta(milliseconds=750 - 1))
    sent_ms = 750 - order.index(1)
    for k, which in enumerate(order):
        for damage in (1 << 31, 0b11 << 29) if which in lost else (0,):
            feed(clock, sent_ms + k, [words[which] ^ damage])
            at = clock.at((sent_ms + k) * MS)
            assert at.validity == "NORMAL"
            assert at.utc_ns is not None
            assert abs(at.utc_ns - ahead_ns - (sent_ms + k) * MS) <= 1 * MS
    assert (clock.at(2800 * MS).validity == "STALE") == bool(lost)


@pytest.mark.parametrize(("ssm", "status"), [(0, "FAILURE_WARNING"), (1, "NO_COMPUTED_DATA"), (2, "FUNCTIONAL_TEST")])
def test_a_time_of_day_that_is_not_normal_ends_what_was_known_until_the_next_set(ssm: int, status: str) -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, 250_000, UTC)
    feed(clock, 0, whole(moment))
    feed(clock, 200, [whole(moment)[0], time(12, 0, 0, ssm=ssm), *whole(moment)[2:]])
    assert clock.at(201 * MS) == (None, status)
    feed(clock, 400, whole(moment + timedelta(milliseconds=400)))
    assert clock.at(401 * MS).validity == "NORMAL"


def test_a_date_that_is_not_normal_ends_what_was_known() -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, 250_000, UTC)
    feed(clock, 0, whole(moment))
    feed(clock, 200, [date(moment) ^ 1 << 29 ^ 1 << 31, *whole(moment + timedelta(milliseconds=200))[1:]])
    assert clock.at(210 * MS) == (None, "NO_COMPUTED_DATA")


def test_another_receiver_may_give_no_fractions() -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, 250_000, UTC)
    feed(clock, 0, whole(moment))
    for second in (10, 11):
        feed(clock, 1000 * second, whole(moment + timedelta(seconds=second))[:2])
    assert clock.at(11_001 * MS) == (utc_ns(moment.replace(second=11, microsecond=0)), "NORMAL")


def test_a_day_that_began_wrong_is_right_once_the_date_is() -> None:
    """The first set comes after midnight, with a date that is still to roll over."""
    clock, midnight = UtcClock(), datetime(2026, 7, 1, tzinfo=UTC)
    for second in range(1, 12):
        moment = midnight + timedelta(seconds=second, milliseconds=250)
        late = 1 if second < 4 else 0
        feed(clock, 1000 * second, [date(moment - timedelta(days=late)), *whole(moment)[1:]])
        at = clock.at((1000 * second + 1) * MS)
        assert at.utc_ns == utc_ns(moment - timedelta(days=late))


@pytest.mark.parametrize("rolls_late", [0, 1, 2])
def test_midnight_takes_no_day_and_gives_none_whichever_word_rolls_over_first(rolls_late: int) -> None:
    """The date may stay behind the time, or run ahead of it, by up to two sets."""
    before, clock = datetime(2027, 12, 31, 23, 59, 57, tzinfo=UTC), UtcClock()
    for ahead in (False, True):
        clock = UtcClock()
        for second in range(7):
            moment = before + timedelta(seconds=second)
            dated = moment + timedelta(seconds=rolls_late if ahead else -rolls_late)
            feed(clock, 1000 * second, [date(dated), *whole(moment)[1:]])
            at = clock.at((1000 * second + 1) * MS)
            assert at.utc_ns == utc_ns(moment)


def test_a_leap_second_is_the_second_before_midnight_counted_twice() -> None:
    clock, day = UtcClock(), datetime(2016, 12, 31, tzinfo=UTC)
    midnight = utc_ns(day + timedelta(days=1))
    seen = []
    feed(clock, -1000, [date(day), time(23, 59, 58)])
    for second, words in enumerate(
        ([date(day), time(23, 59, 59)], [date(day), time(23, 59, 60)], [date(day + timedelta(days=1)), time(0, 0, 0)])
    ):
        feed(clock, 1000 * second, words)
        at = clock.at((1000 * second + 1) * MS)
        assert at.utc_ns is not None
        seen.append(at.utc_ns - midnight)
    assert seen == [-(10**9), 0, 0]


def test_the_years_are_those_of_this_century() -> None:
    clock, moment = UtcClock(), datetime(2099, 2, 28, 1, 2, 3, tzinfo=UTC)
    feed(clock, 0, whole(moment))
    assert clock.at(1 * MS) == (utc_ns(moment), "NORMAL")


def test_a_receiver_that_is_not_precise_yet_says_so() -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, tzinfo=UTC)
    feed(clock, 0, whole(moment))
    feed(clock, 0, [date(moment), time(0, 0, 0, precise=False), *whole(moment)[2:]])
    assert clock.at(1 * MS) == (utc_ns(moment), "NOT_PRECISE")


@pytest.mark.parametrize("late", [0, 1])
def test_words_of_two_sets_are_never_mixed(late: int) -> None:
    """The second set loses its time of day: its fraction must not be laid on the time of the first."""
    clock, first = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, 250_000, UTC)
    feed(clock, 0, whole(first))
    second = whole(first + timedelta(seconds=1, milliseconds=500))
    feed(clock, 1500, [second[0], *second[2:]][late:])
    at = clock.at(1501 * MS)
    assert at.utc_ns == utc_ns(first) + 1500 * MS


def test_nothing_is_known_before_a_set_and_nothing_new_from_words_that_are_not_normal() -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, tzinfo=UTC)
    feed(clock, 0, [date(moment), time(12, 0, 0, ssm=1)])
    assert clock.at(0) == (None, "MISSING")


@pytest.mark.parametrize(("silent_ms", "validity"), [(2400, "NORMAL"), (2600, "STALE"), (60_000, "STALE")])
def test_utc_runs_on_for_two_seconds_and_a_half_and_is_stale_then(silent_ms: int, validity: str) -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, tzinfo=UTC)
    feed(clock, 0, whole(moment))
    feed(clock, silent_ms - 10, whole(moment)[2:])
    assert clock.at(silent_ms * MS).validity == validity


@pytest.mark.parametrize("wrong", [datetime(2000, 1, 1, tzinfo=UTC), datetime(2026, 6, 2, tzinfo=UTC)])
def test_a_date_that_is_corrected_is_followed_at_once(wrong: datetime) -> None:
    clock, moment = UtcClock(), datetime(2026, 6, 1, 12, 0, 0, tzinfo=UTC)
    feed(clock, 0, [date(wrong), time(12, 0, 0)])
    feed(clock, 1000, whole(moment + timedelta(seconds=1)))
    assert clock.at(1001 * MS).utc_ns == utc_ns(moment + timedelta(seconds=1))


def test_a_start_at_midnight_with_a_late_date_is_right_ten_seconds_later() -> None:
    clock, midnight = UtcClock(), datetime(2027, 1, 1, tzinfo=UTC)
    feed(clock, 0, [date(midnight - timedelta(days=1)), time(0, 0, 0)])
    for second in range(1, 13):
        feed(clock, 1000 * second, whole(midnight + timedelta(seconds=second)))
    assert clock.at(12_001 * MS).utc_ns == utc_ns(midnight + timedelta(seconds=12))
