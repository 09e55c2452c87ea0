"""Logs of candump, read back by python-can, and by our own framer as if they had been recorded."""

import struct
from pathlib import Path

import can
import numpy as np
from can.io import CanutilsLogReader

from decoders import formats as f
from decoders.can_frames import Recorded
from decoders.racklink import radar_word, words429
from decoders.racklink_can import CanFramer
from gateway.config import check_config
from simulators import carriers
from simulators.racklink import Packet, word_708, words_429
from tests.gateway.exports.recorded import Flown, To, record
from tests.gateway.made import GNSS, IRU, RACK, RADAR, UTC_NS, Bridge, radial, raw


def messages(path: Path) -> list[can.Message]:
    with CanutilsLogReader(path) as log:
        return list(log)


def recorded(found: list[can.Message]) -> bytes:
    """The frames as a CAN adapter would have recorded them."""
    heads = [
        struct.pack("<QIBB", 0, one.arbitration_id | f.CAN_EXTENDED, 4 * one.is_fd, len(one.data)) for one in found
    ]
    return b"".join(head + bytes(one.data) for head, one in zip(heads, found, strict=True))


def test_the_frames_of_a_flight_decode_to_the_very_words_that_were_sent(flown: Flown, to: To) -> None:
    path, said = to(flown.path, "candump")
    found = messages(path)
    assert said == [f"{path}: {len(found)} frames; can0 is bridge"]
    assert all(one.is_extended_id and one.channel == "can0" for one in found)
    packets = CanFramer(Recorded()).feed(recorded(found))
    blocks = [(packet.channel, words429(packet)) for packet in packets if packet.type == f.WORDS_429]
    for channel in (1, 2, 3):
        sent = flown.of(channel)
        mine = [block for number, block in blocks if number == channel]
        assert np.concatenate([block.words for block in mine]).tolist() == [one.word for one in sent]
        device_us = np.concatenate([block.time_ns for block in mine]) // 1000 % 2**32
        assert device_us.tolist() == [one.time_ns // 1000 % 2**32 for one in sent]
    radar = [(packet, radar_word(packet).data) for packet in packets if packet.type == f.WORD_708]
    assert [data for _, data in radar] == [one.word for one in flown.radar]
    assert (
        np.diff([packet.time_ns for packet, _ in radar]).tolist() == np.diff([r.time_ns for r in flown.radar]).tolist()
    )


def test_a_frame_stands_at_the_utc_of_its_word(flown: Flown, to: To) -> None:
    found = messages(to(flown.path, "candump")[0])
    times = [
        one.timestamp
        for one in found
        if one.arbitration_id >> 12 & 0xF == f.CAN_WORD_708 and not one.arbitration_id & 0xFFF
    ]
    apart = np.diff(times) - np.diff([one.time_ns for one in flown.radar]) / 1e9
    assert np.abs(apart).max() < 2e-6  # the log has microseconds


def test_the_frames_are_those_of_the_table_of_the_link(tmp_path: Path, to: To) -> None:
    """Identifiers and data as the simulators' own FD carrier makes them of the same packets."""
    bridge, carrier = Bridge(), carriers.can(fd=True)
    word = radial(3.0)
    sent = [
        bridge.hello(),
        bridge.words(IRU, 1.0, [0xE00190A1, 0x600C808B]),
        bridge.radar(1.1, word),
        bridge.radar(1.2, word),
    ]
    bodies = words_429([0, 0], [0xE00190A1, 0x600C808B]), word_708(word)
    packets = [
        Packet(f.WORDS_429, IRU, 0, 0, 1_000_000_000, bodies[0]),
        Packet(f.WORD_708, RADAR, 0, 1, 1_100_000_000, bodies[1]),
        Packet(f.WORD_708, RADAR, 0, 2, 1_200_000_000, bodies[1]),
    ]
    path, _ = to(record(tmp_path / "r.mcap", RACK, [raw(0, 2.0, b"".join(sent))]), "candump")
    expected = [(frame.id, frame.data) for packet in packets for frame in carrier.units(packet)]
    found = messages(path)
    assert [(one.arbitration_id, bytes(one.data)) for one in found] == expected
    assert [one.is_fd for one in found] == [False, False, *[True] * 8]


def test_frames_of_a_can_adapter_are_in_the_log_as_they_came(tmp_path: Path, to: To) -> None:
    frames = [
        (f.CAN_EXTENDED | 0x16010085, 0, bytes(range(8))),
        (0x123, 0, b"\1\2"),
        (f.CAN_EXTENDED | 0x16001000, 0x5, bytes(64)),
        (f.CAN_EXTENDED | 0x16001001, 0x4, b"\7"),
        (0x7FF | f.CAN_REMOTE, 0, b""),
        (f.CAN_ERROR | 0x84, 0, bytes(8)),
    ]
    chunk = b"".join(
        struct.pack("<QIBB", 1_000_000 * k, identifier, flags, len(data)) + data
        for k, (identifier, flags, data) in enumerate(frames)
    )
    rack = check_config(
        {"adapters": [{"name": "a", "source": "serial:x"}, {"name": "b", "source": "can:socketcan:can3"}]}, "test"
    )
    path, said = to(record(tmp_path / "r.mcap", rack, [raw(0, 1.0, chunk, adapter="b")]), "candump")
    assert said == [f"{path}: 6 frames; can0 is a, can1 is b"]
    found = messages(path)
    assert [one.channel for one in found[:5]] == ["can1"] * 5  # python-can gives an error frame none
    assert [bytes(one.data) for one in found[:4]] == [data for _, _, data in frames[:4]]
    assert [one.arbitration_id for one in found[:5]] == [0x16010085, 0x123, 0x16001000, 0x16001001, 0x7FF]
    assert [one.is_extended_id for one in found[:4]] == [True, False, True, True]
    assert [(one.is_fd, one.bitrate_switch) for one in found[:4]] == [(False, False)] * 2 + [
        (True, True),
        (True, False),
    ]
    assert found[4].is_remote_frame
    assert found[5].is_error_frame
    since = [one.timestamp - UTC_NS / 1e9 for one in found]  # by the driver's stamps, not by the chunk's
    assert np.allclose(since, [0.001 * k for k in range(6)], atol=1e-6)


def test_frames_of_a_serial_can_adapter_s_text_are_in_the_log_and_foreign_lines_counted(tmp_path: Path, to: To) -> None:
    rack = check_config({"adapters": [{"name": "a", "source": "can:slcan:/dev/ttyACM0"}]}, "test")
    text = b"T160100858a190000000000000\rt1232AABB\r"
    path, said = to(
        record(tmp_path / "r.mcap", rack, [raw(0, 1.0, text[:20], adapter="a"), raw(1, 1.5, text[20:], adapter="a")]),
        "candump",
    )
    (one,) = messages(path)
    assert (one.arbitration_id, bytes(one.data).hex()) == (0x16010085, "a190000000000000")
    assert said[1:] == ["left out: 1 lines of a (foreign frames)"]


def test_words_that_a_frame_could_not_flag_are_left_out_and_counted(tmp_path: Path, to: To) -> None:
    bridge = Bridge()
    sent = [bridge.hello(), bridge.words(GNSS, 1.0, [1, 2], f.FLAG_CODING), bridge.words(GNSS, 1.1, [3])]
    path, said = to(record(tmp_path / "r.mcap", RACK, [raw(0, 2.0, b"".join(sent))]), "candump")
    assert len(messages(path)) == 1
    assert said[1:] == ["left out: 2 ARINC 429 words whose bits cannot be trusted"]
