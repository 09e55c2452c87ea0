"""The byte stream: repeatable, ordered, complete, and timed as serial buses are."""

import struct
from collections import Counter, defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from simulators import scenario, traffic
from simulators.arinc429 import encode
from simulators.carriers import stream
from simulators.link import units
from simulators.schedule import Bus
from tests.simulators.packets import Parsed, label_of, parse

DURATION_S = 12
REFERENCE = scenario.white_mountains(duration_s=DURATION_S)
SHORT = REFERENCE.model_copy(update={"radar": REFERENCE.radar.model_copy(update={"step_deg": 3.0})})
INTERVALS_NS = {  # channel: {label: interval}
    1: {0o310: 150, 0o311: 150, 0o312: 40, 0o313: 40, 0o314: 40, 0o324: 20, 0o325: 20, 0o361: 40, 0o377: 1000},
    2: dict.fromkeys((0o110, 0o120, 0o111, 0o121, 0o076, 0o112, 0o103, 0o130, 0o150, 0o140, 0o260, 0o273, 0o377), 1000),
    3: {0o164: 40, 0o377: 1000},
}


@pytest.fixture(scope="module")
def packets() -> list[Parsed]:
    return [parse(*pair) for pair in units(SHORT, stream())]


@pytest.fixture(scope="module")
def words(packets: list[Parsed]) -> dict[int, list[tuple[int, int]]]:
    """Start and word of every ARINC 429 word by channel."""
    found: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for packet in packets:
        if packet.type == 0x10:
            found[packet.channel] += packet.words()
    return found


@pytest.mark.parametrize("block_ns", [70_000_000, 2_000_000_000])
def test_the_same_scenario_gives_the_same_bytes_however_it_is_cut_into_blocks(
    monkeypatch: pytest.MonkeyPatch, block_ns: int
) -> None:
    usual = list(traffic.traffic(SHORT))
    monkeypatch.setattr(traffic, "BLOCK_NS", block_ns)
    assert list(traffic.traffic(SHORT)) == usual


def test_another_seed_gives_other_bytes_of_the_same_shape() -> None:
    brief = SHORT.model_copy(update={"flight": SHORT.flight.model_copy(update={"duration_s": 2})})
    one, two = (list(traffic.traffic(brief.model_copy(update={"seed": seed}))) for seed in (1, 2))
    assert [time for time, _ in one] == [time for time, _ in two]
    assert one != two


def test_packets_come_in_the_order_in_which_they_end_and_are_numbered_without_a_gap(packets: list[Parsed]) -> None:
    assert all(before.ready_ns <= after.ready_ns for before, after in pairwise(packets))
    assert [packet.sequence for packet in packets] == list(range(len(packets)))
    assert packets[-2].ready_ns < DURATION_S * 1e9


def test_a_packet_is_ready_when_the_last_bit_of_its_last_word_has_left_the_bus(packets: list[Parsed]) -> None:
    for packet in packets:
        if packet.type == 0x10:
            assert packet.ready_ns == packet.words()[-1][0] + 320_000
        if packet.type == 0x20:
            assert packet.ready_ns == packet.time_ns + 1_606_000
            assert len(packet.body) == 202
            assert packet.body[:2] == struct.pack("<H", 1600)


def test_a_bus_never_carries_two_words_within_36_bit_times(words: dict[int, list[tuple[int, int]]]) -> None:
    for sent in words.values():
        assert min(after - before for (before, _), (after, _) in pairwise(sent)) >= 360_000


def test_every_label_keeps_its_interval_but_for_queueing(words: dict[int, list[tuple[int, int]]]) -> None:
    for channel, intervals in INTERVALS_NS.items():
        starts = defaultdict(list)
        for start, word in words[channel]:
            starts[label_of(word)].append(start)
        assert starts.keys() == intervals.keys()
        for label, interval_ms in intervals.items():
            gaps = np.diff(starts[label]) / 1e6
            assert np.mean(gaps) == pytest.approx(interval_ms, rel=0.01)
            assert np.all(np.abs(gaps - interval_ms) < 8 * 0.36)


def test_the_words_of_a_gnss_epoch_stand_together_in_one_packet(packets: list[Parsed]) -> None:
    blocks = [packet for packet in packets if packet.type == 0x10 and packet.channel == 2]
    assert len(blocks) == DURATION_S
    for block in blocks:
        starts, sent = zip(*block.words(), strict=True)
        assert [label_of(word) for word in sent] == list(INTERVALS_NS[2])
        assert set(np.diff(starts)) == {360_000}


def test_a_packet_holds_at_most_ten_milliseconds_of_traffic(packets: list[Parsed]) -> None:
    spans = [packet.words()[-1][0] - packet.time_ns for packet in packets if packet.type == 0x10]
    assert max(spans) < 10_000_000


def test_hello_comes_first_and_every_ten_seconds_and_lists_all_channels(packets: list[Parsed]) -> None:
    hellos = [packet for packet in packets if packet.type == 0x01]
    assert packets[0] == hellos[0]
    assert [hello.time_ns for hello in hellos] == [0, 10_000_000_000]
    listed = list(struct.iter_unpack("<BBBB", hellos[0].body[6:]))
    assert listed == [(0, 0x70, 0, 0), (1, 0x2A, 0, 0x04), (2, 0x2A, 0, 0x0B), (3, 0x2A, 0, 0x07)]


def test_each_heartbeat_counts_the_words_sent_before_it(packets: list[Parsed]) -> None:
    sent: Counter[int] = Counter()
    beats = 0
    for packet in packets:
        sent[packet.channel] += {0x10: len(packet.body) // 8, 0x20: 1}.get(packet.type, 0)
        if packet.type == 0x02:
            beats += 1
            assert list(struct.iter_unpack("<BII", packet.body)) == [
                (channel, sent[channel], 0) for channel in range(4)
            ]
    assert beats == DURATION_S + 1


def test_the_last_packet_is_a_heartbeat_so_that_losses_at_the_end_count(packets: list[Parsed]) -> None:
    assert (packets[-1].type, packets[-1].ready_ns) == (0x02, DURATION_S * 10**9)


def test_the_radar_of_the_reference_sends_80_words_a_second() -> None:
    brief = REFERENCE.model_copy(update={"flight": REFERENCE.flight.model_copy(update={"duration_s": 1.0})})
    radar_words = [packet for packet in (parse(*pair) for pair in units(brief, stream())) if packet.type == 0x20]
    assert len(radar_words) == 80
    assert {packet.body[2] for packet in radar_words} == {0xB4}


def test_words_that_fall_due_together_queue_in_order_and_the_queue_outlives_a_call() -> None:
    bus = Bus(360)
    assert bus.starts(np.array([0, 0, 100, 5000])).tolist() == [0, 360, 720, 5000]
    assert bus.starts(np.array([5001, 9000])).tolist() == [5360, 9000]
    assert bus.starts(np.array([], np.int64)).tolist() == []


def test_the_first_radio_altitude_is_a_word_of_the_encoder(words: dict[int, list[tuple[int, int]]]) -> None:
    word = words[3][0][1]
    feet = (word >> 12 & 0xFFFF) / 8
    assert encode(0o164, feet) == word


def test_a_tile_smaller_than_the_range_flies_when_allowed_and_nothing_answers_from_outside() -> None:
    tile = Path(__file__).parents[1] / "data" / "terrain" / "sierra_nevada_1arcsec_wgs84.tif"
    settings = scenario.Scenario(
        flight=scenario.Flight(
            latitude_deg=37.39902, longitude_deg=-119.40492, height_m=2411, heading_deg=52.2, duration_s=5
        ),
        world=scenario.World(terrain=str(tile), incomplete=True),
        radar=scenario.Radar(step_deg=3.0, tilt_deg=-1.0),
    )
    radials = traffic.prepare(settings).radar.between(0.0, 5.0)
    left, ahead = radials.bins[radials.scan_angle_deg == -90][0], radials.bins[radials.scan_angle_deg == 0][0]
    assert np.count_nonzero(ahead) > 50
    assert np.count_nonzero(left[300:]) < 3  # noise alone
    refused = settings.model_copy(update={"world": scenario.World(terrain=str(tile))})
    with pytest.raises(ValueError, match="incomplete = true"):
        next(traffic.traffic(refused))


def test_a_flight_into_the_ground_is_refused_with_the_time() -> None:
    low = SHORT.model_copy(update={"flight": SHORT.flight.model_copy(update={"height_m": 300.0})})
    with pytest.raises(ValueError, match="meets the ground after 0 s"):
        next(traffic.traffic(low))
