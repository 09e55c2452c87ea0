"""What is said of a bus: too fast, silent, overloaded, or read the wrong way; told once, and again when it is over."""

import numpy as np
import pytest

from decoders.arinc429 import decode, load_definitions
from decoders.formats import KIND_429_HIGH, KIND_429_LOW
from decoders.health429 import BusHealth, Finding
from tests.decoders.bus import word429

MS = 1_000_000
IRU = load_definitions("iru_704")
PITCH, LATITUDE = word429(0o324, {}, ssm=3), word429(0o310, {}, ssm=3)


class Bus:
    """Sends words by the millisecond and collects what is found."""

    def __init__(self, kind: int = KIND_429_HIGH, orientation: str = "wire") -> None:
        self.health = BusHealth(IRU, orientation, kind)
        self.found: list[Finding] = []
        self._orientation = orientation

    def send(self, *timed: tuple[float, int]) -> "Bus":
        """Words as (time in ms, word), in blocks of eight."""
        ordered = sorted(timed)
        for start in range(0, len(ordered), 8):
            block = ordered[start : start + 8]
            times = np.array([round(time * MS) for time, _ in block], np.int64)
            words = np.array([word for _, word in block], np.uint32)
            self.found += self.health.feed(times, words, decode(words, IRU, self._orientation))
        return self

    def every(self, interval_ms: float, word: int, start_ms: float = 0, stop_ms: float = 5000) -> "Bus":
        return self.send(*((time, word) for time in np.arange(start_ms, stop_ms, interval_ms)))

    @property
    def told(self) -> list[tuple[str, bool]]:
        return [(finding.about, finding.wrong) for finding in self.found]


def mixed(*streams: tuple[float, int], stop_ms: float = 5000) -> list[tuple[float, int]]:
    return [(float(time), word) for interval, word in streams for time in np.arange(0, stop_ms, interval)]


def test_a_bus_at_its_rates_says_nothing() -> None:
    bus = Bus().send(*mixed((20, PITCH), (150, LATITUDE)))
    assert bus.found == []
    assert bus.health.peak_words_per_s == pytest.approx(50 + 1 / 0.15, rel=0.05)


def test_a_label_that_comes_too_fast_is_told_with_both_intervals_and_again_when_it_is_over() -> None:
    """324 may come every 10 to 50 ms."""
    bus = Bus().every(4, PITCH, 0, 2500).every(20, PITCH, 2500, 6000)
    assert bus.told == [("rate of 324", True), ("rate of 324", False)]
    assert bus.found[0].reason == "label 324 comes every 4.0 ms, 10 is the shortest interval"


def test_a_label_that_stops_is_told_although_the_bus_goes_on() -> None:
    bus = Bus().send(
        *mixed((20, PITCH), stop_ms=7000), *[(t, LATITUDE) for t in (*range(0, 2000, 150), *range(4500, 7000, 150))]
    )
    assert bus.told == [("label 310", True), ("label 310", False)]
    assert "label 310 has not come for" in bus.found[0].reason
    assert "200 is the longest interval" in bus.found[0].reason


@pytest.mark.parametrize(("kind", "most"), [(KIND_429_HIGH, 2777.8), (KIND_429_LOW, 347.2)])
def test_more_words_than_a_bus_carries_are_told(kind: int, most: float) -> None:
    words = [word429(label, {}, ssm=3) for label in (0o310, 0o311)]
    at_most = [(k * 1000 / most, words[k % 2]) for k in range(round(2.5 * most))]
    assert "load" not in dict(Bus(kind).send(*at_most).told)
    too_many = [(time * 0.9, word) for time, word in at_most]
    (load,) = [finding for finding in Bus(kind).send(*too_many).found if finding.about == "load"]
    assert f"carries {most:.1f} at most" in load.reason


def test_labels_that_only_make_sense_the_other_way_round_name_the_orientation() -> None:
    turned = [
        (time, word & ~0xFF | int(f"{word & 0xFF:08b}"[::-1], 2)) for time, word in mixed((15, PITCH), (150, LATITUDE))
    ]
    bus = Bus().send(*turned)
    assert ("orientation", True) in bus.told
    assert ("definitions", True) not in bus.told
    (reason,) = [finding.reason for finding in bus.found if finding.about == "orientation"]
    assert reason.startswith("0% of the labels belong to iru_704, 100% if read the other way round")
    assert Bus(orientation="label_swapped").send(*turned).found == []


def test_labels_of_other_equipment_name_the_definitions() -> None:
    bus = Bus().send(*mixed((15, word429(0o203, {}, ssm=3)), (20, word429(0o204, {}, ssm=3))))
    assert bus.told == [("definitions", True)]


def test_bad_parity_in_many_words_is_told_and_a_few_bad_words_are_not() -> None:
    even = word429(0o324, {}, ssm=3, odd=False)
    assert Bus().send(*mixed((20, PITCH), (200, even))).found == []
    assert ("parity", True) in Bus().send(*mixed((20, PITCH), (30, even))).told


def test_a_box_that_names_another_equipment_is_told() -> None:
    bus = Bus().send((0, word429(0o377, {11: (0x00B, 12)})), (1000, word429(0o377, {11: (0x004, 12)})))
    assert bus.told == [("equipment", True), ("equipment", False)]
    assert bus.found[0].reason == "the box says it is equipment 00B, it is read as iru_704"


def test_a_clock_that_begins_anew_makes_no_findings() -> None:
    assert Bus().every(20, PITCH, 9000, 12000).every(20, PITCH, 0, 3000).found == []


@pytest.mark.parametrize("interval_ms", [7.4, 7.5, 7.6, 8.9, 9.0, 9.1, 50.0, 54.0, 55.0, 60.0, 62.4, 62.6])
def test_no_rate_however_close_to_a_limit_is_told_and_taken_back_in_turn(interval_ms: float) -> None:
    jitter = np.random.default_rng(3).normal(0, 0.2, round(20_000 / interval_ms))
    times = np.arange(len(jitter)) * interval_ms + jitter
    assert len(Bus().send(*((float(time), PITCH) for time in times)).found) <= 1


def test_a_label_that_comes_too_slowly_is_told_from_its_mean_interval() -> None:
    bus = Bus().send(*mixed((20, PITCH), (400, LATITUDE), stop_ms=10_000))
    assert bus.told == [("slowness of 310", True)]
    assert bus.found[0].reason == "label 310 comes every 400.0 ms, 200 is the longest interval"


def test_one_stray_word_is_no_label_that_stopped() -> None:
    assert Bus().send(*mixed((20, PITCH), stop_ms=10_000), (500, LATITUDE)).found == []


@pytest.mark.parametrize("share", [0.1, 0.15, 0.2, 0.25])
def test_a_share_of_bad_parity_is_not_told_and_taken_back_in_turn(share: float) -> None:
    random = np.random.default_rng(4)
    words = [word429(0o324, {}, ssm=3, odd=bool(random.random() >= share)) for _ in range(3000)]
    told = Bus().send(*((20.0 * k, word) for k, word in enumerate(words))).told
    assert sum(about == "parity" for about, _ in told) <= 3


def test_a_label_that_comes_from_two_sources_is_told_and_one_to_all_is_not() -> None:
    one, other, to_all = (word429(0o324, {9: (sdi, 2)}, ssm=3) for sdi in (1, 2, 0))
    assert Bus().send(*mixed((40, one), (40, to_all))).found == []
    found = Bus().send(*mixed((40, one), (41, other))).found
    assert [finding.about for finding in found] == ["sources"]
    assert found[0].reason.startswith("labels 324 come from several sources (SDI): say with sdi")
    twenty_bits = [word429(0o310, {9: (low, 2)}, ssm=3) for low in (1, 2)]
    assert Bus().send(*mixed((300, twenty_bits[0]), (310, twenty_bits[1]))).found == []
