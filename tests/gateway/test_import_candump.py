"""Logs of candump: frames as a CAN adapter records them, and words read with the definitions that are given."""

import struct
from pathlib import Path

import pytest

from gateway.events import StateEvent
from gateway.imports.plan import channels_of
from tests.gateway.importing import events, imported, notes, pitch_word, summary
from tests.gateway.live import raw_records, recorded_bytes
from tests.gateway.made import only

LOG = b"""(1780000000.000100) can0 1601008B#8B800C6060E31600
(1780000000.000300) can1 123#0102
(1780000000.000500) can0 16012000#0200000002000000
(1780000000.000600) can0 16001000##10580B386590000000040
what is this
(1780000000.000700) can0 20000004#0001000000000000
(1780000001.000800) can0 123#R2
(1780000001.000900) can0 1601008B#8B800C6061E31600 R
"""


def test_candump_frames_are_recorded_as_a_can_adapter_records_them(tmp_path: Path) -> None:
    out = imported(tmp_path, "candump", LOG)
    can0 = recorded_bytes(out, "can0")
    word, second = bytes.fromhex("8b800c6060e31600"), bytes.fromhex("8b800c6061e31600")
    assert can0 == b"".join(
        (
            struct.pack("<QIBB", 0, 0x9601008B, 0, 8) + word,
            struct.pack("<QIBB", 400_000, 0x96012000, 0, 8) + bytes.fromhex("0200000002000000"),
            struct.pack("<QIBB", 500_000, 0x96001000, 5, 10) + bytes.fromhex("0580b386590000000040"),
            struct.pack("<QIBB", 600_000, 0x20000004, 0, 8) + bytes.fromhex("0001000000000000"),
            struct.pack("<QIBB", 1_000_700_000, 0x40000123, 0, 2) + bytes(2),
            struct.pack("<QIBB", 1_000_800_000, 0x9601008B, 0, 8) + second,
        )
    )
    assert recorded_bytes(out, "can1") == struct.pack("<QIBB", 200_000, 0x123, 0, 2) + b"\1\2"
    stamps = [record.stamp.utc_ns for record in raw_records(out)]
    # each chunk has the time of its last frame; the note of a strange line and the second's end cut them, and the first
    # frame of an interface or behind a pause is alone
    assert [stamp - 1_780_000_000_000_000_000 for stamp in stamps] == [
        100_000, 300_000, 600_000, 700_000, 1_000_800_000, 1_000_900_000,
    ]  # fmt: skip
    assert "no frame: what is this" in notes(out)
    found = summary(out)
    assert (found["can0.words_429"], found["can0.foreign_frames"], found["can0.error_frames"]) == (2, 1, 1)
    assert found["can1.foreign_frames"] == 1


def test_words_of_a_candump_log_are_read_with_the_definitions_that_are_given(tmp_path: Path) -> None:
    lines = []
    for k in range(50):
        word, time_us = pitch_word(2.5), 50_000 * k
        data = (word + struct.pack("<I", time_us)).hex().upper()
        lines.append(f"({1_780_000_000 + time_us / 1e6:.6f}) vcan0.1 16040{word[0]:03X}#{data}\n".encode())
    out = imported(tmp_path, "candump", b"".join(lines), channels=channels_of(["4=arinc429:iru_704"]))
    assert only(StateEvent, events(out))[-1].values["pitch_deg"] == pytest.approx(2.5, abs=0.01)
    assert {record.adapter for record in raw_records(out)} == {"vcan0_1"}
