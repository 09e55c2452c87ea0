"""What goes wrong inside the bridge, and that its books stay right to the word."""

import struct
from collections import Counter
from collections.abc import Sequence

import pytest

from simulators.faults.device import FAULTS
from simulators.ledger import Ledger
from simulators.racklink import Packet
from simulators.scenario import LinkFault
from tests.simulators.small_bridge import SECOND_NS, SECONDS, WORD, packets

HEALTHY = packets()
WORDS = {(0, 0x20): 50 * SECONDS, (1, 0x10): 500 * SECONDS, (2, 0x10): 40 * SECONDS}


def counts(packet: Packet) -> dict[int, tuple[int, int]]:
    return {channel: (received, lost) for channel, received, lost in struct.iter_unpack("<BII", packet.body)}


def of(found: Sequence[Packet], kind: int, channel: int = 1) -> list[Packet]:
    return [packet for packet in found if (packet.type, packet.channel) == (kind, channel)]


def test_a_healthy_bridge_passes_on_every_word_that_its_buses_carried() -> None:
    ledger = Ledger()
    found = packets(ledger=ledger)
    assert ledger.carried == WORDS
    assert ledger.lost == {}
    assert counts(found[-1]) == {0: (50 * SECONDS, 0), 1: (500 * SECONDS, 0), 2: (40 * SECONDS, 0)}


def test_words_lost_in_the_fifo_are_counted_and_the_next_packet_of_the_channel_says_so() -> None:
    ledger = Ledger()
    fault = LinkFault(name="fifo_overflow", start_s=1.0, stop_s=1.05, channel=1)
    found = packets([fault], ledger)
    assert ledger.carried == WORDS
    assert ledger.lost == {(1, 0x10): 25}
    assert counts(found[-1])[1] == (500 * SECONDS - 25, 25)
    assert [packet.flags for packet in of(found, 0x10)] == [0] * 100 + [0x01] + [0] * (100 * SECONDS - 106)
    assert {packet.flags for packet in found if packet.channel != 1} == {0}
    assert [packet.sequence for packet in found] == list(range(len(HEALTHY) - 5))


def test_chance_says_which_share_of_the_packets_is_hit() -> None:
    ledger = Ledger()
    packets([LinkFault(name="fifo_overflow", chance=0.3)], ledger)
    assert ledger.lost[1, 0x10] / ledger.carried[1, 0x10] == pytest.approx(0.3, abs=0.1)
    assert ledger.lost[0, 0x20] > 0


def test_a_wrong_parity_is_in_the_word_and_flagged() -> None:
    found = of(packets([LinkFault(name="parity_errors", start_s=1.0, chance=0.5)]), 0x10)
    flagged = [packet for packet in found if packet.flags]
    assert {packet.flags for packet in flagged} == {0x02}
    assert 0.3 < len(flagged) / len(found) * SECONDS / (SECONDS - 1) < 0.7
    for packet in flagged:
        words = Counter(word for _, word in struct.iter_unpack("<II", packet.body))
        assert words == {WORD: 4, WORD ^ 0x8000_0000: 1}


def test_a_radar_word_of_another_length_says_its_bits_and_is_flagged() -> None:
    ledger = Ledger()
    found = of(packets([LinkFault(name="word_length_errors")], ledger), 0x20, channel=0)
    bits = [struct.unpack_from("<H", packet.body)[0] for packet in found]
    assert {packet.flags for packet in found} == {0x08}
    assert [len(packet.body) - 2 for packet in found] == [-(-count // 8) for count in bits]
    assert 1600 not in bits
    assert 1 <= min(bits) < 1600 < max(bits) <= 2047
    whole = of(HEALTHY, 0x20, channel=0)
    for packet, before, count in zip(found, whole, bits, strict=True):
        word, original = (int.from_bytes(each.body[2:], "little") for each in (packet, before))
        assert word == original & (1 << count) - 1
    assert ledger.carried == WORDS


@pytest.mark.parametrize("clock_s", [0.5, 5000.0])
def test_the_device_clock_leaps_and_goes_on_from_there(clock_s: float) -> None:
    found = packets([LinkFault(name="clock_jump", start_s=2.0, clock_s=clock_s)])
    leaps = [after.time_ns - before.time_ns for before, after in zip(HEALTHY, found, strict=True)]
    assert Counter(leaps).keys() == {0, round((clock_s - 2.0) * SECOND_NS)}
    assert leaps == sorted(leaps, reverse=clock_s < 2)


def test_a_clock_that_restarts_is_never_below_nought() -> None:
    found = packets([LinkFault(name="clock_jump", start_s=2.0, clock_s=0.0)])
    assert min(packet.time_ns for packet in found) == 0


def test_a_babbling_box_fills_its_bus_with_nonsense_and_says_nothing_of_its_own() -> None:
    ledger = Ledger()
    found = packets([LinkFault(name="babble", start_s=1.0, stop_s=2.0, channel=2)], ledger)
    babbled = [packet for packet in of(found, 0x10, channel=2) if len(packet.body) > 16]
    assert len(babbled) == 99  # of 10 ms each; the last one is not complete before the end
    assert {len(packet.body) // 8 for packet in babbled} == {27}  # 27 words of 360 us
    assert [packet.time_ns for packet in babbled] == [SECOND_NS + 10_000_000 * k for k in range(99)]
    assert ledger.carried[2, 0x10] == 40 * (SECONDS - 1) + 99 * 27
    assert counts(found[-1])[2] == (ledger.carried[2, 0x10], 0)
    assert of(found, 0x10, channel=1) == [
        packet._replace(sequence=mine.sequence) for packet, mine in zip(of(HEALTHY, 0x10), of(found, 0x10), strict=True)
    ]


@pytest.mark.parametrize("name", FAULTS)
def test_the_same_seed_gives_the_same_faults_and_outside_their_window_nothing_changes(name: str) -> None:
    fault = LinkFault.model_validate({"name": name, "start_s": 1.0, "stop_s": 2.0})
    assert packets([fault]) == packets([fault]) != HEALTHY
    before = [packet for packet in packets([fault]) if packet.time_ns < 0.9 * SECOND_NS]
    if name != "clock_jump":
        assert before == [packet for packet in HEALTHY if packet.time_ns < 0.9 * SECOND_NS]
