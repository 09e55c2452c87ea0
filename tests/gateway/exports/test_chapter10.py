"""Chapter 10 files, read back by pychapter10 and by hand from the standard's layout."""

import struct
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chapter10 import C10
from chapter10.arinc429 import ARINC429F0
from chapter10.computer import ComputerF1
from chapter10.message import MessageF0
from chapter10.time import TimeF1

from decoders import formats as f
from gateway.exports import chapter10_layouts as layouts
from gateway.records import Raw, Stamp
from gateway.words import STEP_NS
from simulators import racklink
from tests.gateway.exports.recorded import Flown, To, record
from tests.gateway.made import GNSS, HELLO, IRU, RACK, RADAR, SECOND_NS, UTC_NS, Bridge, radial, raw

GOLDEN = "25eb07002c0000001400000000000038e8030000000054270200000000006005a19001e045236105a19001e0"
WORD = 0xE00190A1


def packets(path: Path) -> list[Any]:
    with path.open("rb") as file:
        return list(C10(file))


def entries(path: Path, kind: Any) -> Iterator[tuple[int, int, Any]]:
    """Channel id, UTC in ns and entry of each word, timed by the time packet before it."""
    time_ns = rtc = 0
    for packet in packets(path):
        if isinstance(packet, TimeF1):
            time_ns, rtc = int(np.datetime64(packet.time, "ns").astype(np.int64)), packet.rtc
        elif isinstance(packet, kind):
            at = packet.rtc
            for entry in list(packet):
                at = entry.ipts if kind is MessageF0 else at + entry.gap_time
                yield packet.channel_id, time_ns + 100 * (at - rtc), entry


def made(path: Path, *packets_sent: bytes) -> Path:
    return record(path, RACK, [raw(0, 10.0, b"".join(packets_sent))])


def test_the_packet_that_three_readers_agree_on_comes_out_byte_for_byte() -> None:
    errors = np.full(2, layouts.PARITY_429, np.uint32)
    words = layouts.words_429(np.array([0, 0x12345]), np.full(2, WORD, np.uint32), errors, 5, True)
    packet = layouts.packet(7, layouts.ARINC_429, 0, 1000, b"\2\0\0\0" + words, version=0)
    assert packet.hex() == GOLDEN


def test_every_word_is_read_back_with_its_time_by_its_channel(flown: Flown, to: To) -> None:
    path, _ = to(flown.path, "chapter10")
    channels: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for channel, utc_ns, entry in entries(path, ARINC429F0):
        (word,) = struct.unpack("<I", entry.data)
        channels[channel].append((utc_ns, word))
        assert (entry.parity_error, entry.format_error) == (0, 0)
        assert entry.bus == channel - 2  # the radar is channel 2, bus 0
    assert sorted(channels) == [3, 4, 5]
    ahead_ns = channels[3][0][0] - flown.of(1)[0].time_ns
    assert 0 <= ahead_ns - flown.least_delay_ns <= STEP_NS
    for channel, found in channels.items():
        sent = flown.of(channel - 2)
        assert [word for _, word in found] == [one.word for one in sent]
        off_ns = np.array([utc_ns for utc_ns, _ in found]) - [one.time_ns + ahead_ns for one in sent]
        assert np.abs(off_ns).max() <= 100


def test_every_radar_word_is_read_back_as_a_message_with_its_time(flown: Flown, to: To) -> None:
    path, _ = to(flown.path, "chapter10")
    found = [(utc_ns, entry) for _, utc_ns, entry in entries(path, MessageF0)]
    assert [entry.data for _, entry in found] == [one.word for one in flown.radar]
    assert not any(entry.format_error or entry.data_error or entry.subchannel for _, entry in found)
    apart_ns = np.diff([utc_ns for utc_ns, _ in found]) - np.diff([one.time_ns for one in flown.radar])
    assert np.abs(apart_ns).max() <= 100


def test_the_setup_record_comes_first_then_the_time_of_each_second_before_its_words(flown: Flown, to: To) -> None:
    path, said = to(flown.path, "chapter10")
    found = packets(path)
    assert isinstance(found[0], ComputerF1)
    assert isinstance(found[1], TimeF1)
    words = f"{len(flown.words)} ARINC 429 words, {len(flown.radar)} radar words"
    assert said == [f"{path}: {words} on 4 channels in {len(found)} packets"]
    setup = {key.decode(): value.decode() for key, value in found[0][""].items()}
    assert [setup[f"R-1\\CDT-{n}"] for n in range(1, 6)] == ["TIMEIN", "MSGIN", "429IN", "429IN", "429IN"]
    assert [setup[f"R-1\\TK1-{n}"] for n in range(1, 6)] == ["1", "2", "3", "4", "5"]
    assert [setup[f"R-1\\DSI-{n}"] for n in range(2, 6)] == [f"bridge-{k}" for k in range(4)]
    assert (setup["R-1\\ASN-4-1"], setup["R-1\\ANM-4-1"]) == ("2", "gnss_743a")
    seconds = [packet.rtc // layouts.RTC_HZ for packet in found if isinstance(packet, TimeF1)]
    assert seconds == [*range(seconds[0], seconds[0] + len(seconds))]
    second = 0
    for packet in found[1:]:
        second = packet.rtc // layouts.RTC_HZ if isinstance(packet, TimeF1) else second
        assert packet.rtc // layouts.RTC_HZ == second


def test_lengths_checksums_and_sequences_are_those_of_the_standard(flown: Flown, to: To) -> None:
    """Table 10-12 by hand: sync, channel, packet and data length, version, sequence, flags, type, RTC, checksum."""
    data = to(flown.path, "chapter10")[0].read_bytes()
    at, sequences = 0, defaultdict[int, int](int)
    while at < len(data):
        sync, channel, whole, body, _, sequence, flags, _ = struct.unpack_from("<HHIIBBBB", data, at)
        assert (sync, flags, whole % 4) == (0xEB25, 0, 0)
        assert 24 + body <= whole < 24 + body + 4
        assert sum(struct.unpack_from("<11H", data, at)) % 2**16 == struct.unpack_from("<H", data, at + 22)[0]
        assert sequence == sequences[channel] % 256
        sequences[channel] += 1
        at += whole
    assert at == len(data)


def test_a_gap_that_the_field_cannot_hold_begins_a_packet(tmp_path: Path, to: To) -> None:
    bridge = Bridge()
    offsets = [0, 99_999_900, 99_999_900 + 100_000_100, 500_000_000]
    body = racklink.words_429(offsets, [WORD] * 4)
    sent = bridge.packet(f.WORDS_429, IRU, 1.0, body)
    path, _ = to(made(tmp_path / "r.mcap", bridge.hello(), sent), "chapter10")
    found = [[entry.gap_time for entry in packet] for packet in packets(path) if isinstance(packet, ARINC429F0)]
    assert found == [[0, 999_999], [0], [0]]


def test_what_the_bridge_said_against_words_is_in_their_bits(tmp_path: Path, to: To) -> None:
    bridge = Bridge()
    hello = racklink.hello(
        7, 1, [(RADAR, f.KIND_708, 0, 0), (GNSS, f.KIND_429_LOW, 0, 11), (IRU, f.KIND_429_HIGH, 1, 4)]
    )
    sent = [
        bridge.hello(body=hello),
        bridge.words(GNSS, 1.0, [WORD, WORD ^ 1 << 31]),
        bridge.words(GNSS, 1.01, [WORD], f.FLAG_PARITY),
        bridge.words(GNSS, 1.02, [WORD], f.FLAG_WORD_LENGTH | f.FLAG_FIFO_OVERFLOW),
        bridge.words(IRU, 1.0, [WORD]),
        bridge.words(9, 1.0, [WORD]),
    ]
    path, _ = to(made(tmp_path / "r.mcap", *sent), "chapter10")
    found = [(c - 2, e.bus_speed, e.parity_error, e.format_error, e.bus) for c, _, e in entries(path, ARINC429F0)]
    assert [row[1:] for row in found if row[4] == GNSS] == [
        (0, 0, 0, GNSS),
        (0, 1, 0, GNSS),
        (0, 1, 0, GNSS),
        (0, 0, 1, GNSS),
    ]
    assert [row[1:] for row in found if row[4] != GNSS] == [(1, 0, 0, IRU), (1, 0, 0, 9)]
    overflows = [packet.data_overflow_error for packet in packets(path) if isinstance(packet, ARINC429F0)]
    assert sorted(overflows) == [0, 0, 0, 1]
    (turned,) = [entry.data for channel, _, entry in entries(path, ARINC429F0) if entry.bus == IRU]
    assert turned == bytes([int(f"{WORD & 0xFF:08b}"[::-1], 2)]) + struct.pack("<I", WORD)[1:]


@pytest.mark.parametrize(
    ("bits", "flags", "format_error", "data_error"),
    [(1600, 0, 0, 0), (397, f.FLAG_WORD_LENGTH, 1, 0), (1600, f.FLAG_CODING, 0, 1), (392, f.FLAG_SYNC, 1, 1)],
)
def test_radar_words_of_any_length_keep_their_bytes_and_say_what_is_wrong(
    bits: int, flags: int, format_error: int, data_error: int, tmp_path: Path, to: To
) -> None:
    bridge, word = Bridge(), radial(3.0)[: (bits + 7) // 8]
    sent = bridge.packet(f.WORD_708, RADAR, 1.0, racklink.word_708(word, bits), flags)
    path, said = to(made(tmp_path / "r.mcap", bridge.hello(), sent), "chapter10")
    ((_, _, entry),) = entries(path, MessageF0)
    assert entry.data == word
    # By hand, bits 30 and 31 of the second word as irig106lib has them: pychapter10 takes them for the subchannel's.
    data = path.read_bytes()
    (said_of_it,) = struct.unpack_from("<H", data, data.index(word) - 2)
    assert said_of_it == format_error << 14 | data_error << 15
    filled = [line for line in said if "unfinished bits" in line]
    assert bool(filled) == bool(bits % 8)


def test_a_recording_without_words_is_a_setup_record_alone(tmp_path: Path, to: To) -> None:
    path, _ = to(made(tmp_path / "r.mcap", Bridge().hello(body=HELLO)), "chapter10")
    assert [type(packet) for packet in packets(path)] == [ComputerF1]


def test_a_step_of_the_host_s_utc_is_in_the_time_packets(tmp_path: Path, to: To) -> None:
    bridge = Bridge()
    first, second = bridge.hello() + bridge.words(IRU, 0.9, [WORD]), bridge.words(IRU, 1.9, [WORD])
    back_ns = 40 * 86_400 * SECOND_NS
    stepped = Stamp(2 * SECOND_NS, UTC_NS + 2 * SECOND_NS - back_ns)
    path, _ = to(
        record(tmp_path / "r.mcap", RACK, [raw(0, 1.0, first), Raw(1, stepped, "bridge", second)]), "chapter10"
    )
    found = [utc_ns for _, utc_ns, _ in entries(path, ARINC429F0)]
    assert found == [UTC_NS + SECOND_NS, UTC_NS + 2 * SECOND_NS - back_ns]
