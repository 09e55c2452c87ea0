"""The description of our CAN frames reads frames as other people's tools do: cantools on bytes made by `struct`."""

import struct
from typing import Any

import cantools
import pytest
from cantools.database.can.database import Database

from decoders.definitions import load_definitions
from examples import dbc
from tests.decoders.bus import word429
from tests.decoders.test_racklink_page import RECORD, can_frames

RADAR_HEADER = {
    "label": "055",
    "control_accept": 3,
    "slave": 0,
    "annunciations": 2,
    "stabilised": 1,
    "mode": "weather_turbulence",
    "tilt": -3.25,
    "gain": 0,
    "range": 160,
    "data_accept": 3,
    "scan_angle": 349.98046875,
}


@pytest.fixture(scope="module")
def database() -> Database:
    found = cantools.database.load_file(dbc.FILE)
    assert isinstance(found, Database)
    return found


def read(database: Database, identifier: int, data: bytes) -> dict[str, Any]:
    """The fields of a frame, names of codes as text."""
    fields = database.decode_message(identifier, data)
    assert isinstance(fields, dict)
    return {name: value if isinstance(value, int | float) else str(value) for name, value in fields.items()}


def test_the_file_is_the_one_that_make_dbc_writes() -> None:
    assert dbc.FILE.read_text("ascii") == dbc.text(), "run `make dbc`"


def test_the_frames_of_the_page_read_as_the_page_says(database: Database) -> None:
    word = read(database, *can_frames("can429")[0])
    assert word == {
        "label": "321",
        "sdi": 0,
        "value": 0.52734375,
        "ssm": "NORMAL",
        "parity": 0,
        "bridge_time": 1_500_000,
    }
    assert read(database, *can_frames("canheartbeat")[0]) == {"words_received": 2, "words_lost": 2}
    radar = read(database, *can_frames("canfd708")[0])
    head = {"word_counter": 5, "time_ns": 1_502_000_000, "bit_count": 1600, "flags": 0, "faults": 1}
    assert radar == {**head, **RADAR_HEADER}


def test_the_parts_of_fields_cut_by_classic_frames_add_up(database: Database) -> None:
    time_ns = 2**63 + 12_345
    record = struct.pack("<QHB", time_ns, 1600, 0x10) + RECORD[11:13] + b"\xff\xff" + RECORD[15:]
    frames = [read(database, 0x16081000 + k, b"\7" + record[7 * k : 7 * k + 7]) for k in range(3)]
    said = {name: value for frame in frames for name, value in frame.items()}
    assert said["time_ns"] + said["time_ns_from_bit_56"] == time_ns
    assert said["faults"] + said["faults_from_bit_6"] == 0b1111111
    assert (said["word_counter"], said["bit_count"], said["flags"]) == (7, 1600, 0x10)


@pytest.mark.parametrize(("channel", "name"), [(1, "iru_704"), (2, "gnss_743a")])
def test_every_label_of_a_channel_has_its_frame_and_no_other(channel: int, name: str, database: Database) -> None:
    described = [one for one in database.messages if one.frame_id >> 12 == 0b10110 << 12 | channel << 4]
    assert all(one.is_extended_frame for one in described)
    low_bytes = {f"{label:08b}"[::-1]: label for label in load_definitions(name).labels}
    assert {f"{one.frame_id & 0xFFF:08b}" for one in described} == {*low_bytes}
    for one in described:
        word = struct.pack("<II", one.frame_id & 0xFF, 0)
        assert read(database, one.frame_id, word)["label"] == f"{low_bytes[f'{word[0]:08b}']:03o}"


@pytest.mark.parametrize(
    ("identifier", "label", "fields", "ssm", "said"),
    [
        (0x16020012, 0o110, {9: (2**20 - 2**18, 20), 29: (1, 1)}, 3, {"value": -45.0, "ssm": "NORMAL"}),
        (0x16010013, 0o310, {9: (2**19, 20)}, 1, {"value": 90.0, "ssm": "NO_COMPUTED_DATA"}),
        (0x16020016, 0o150, {24: (23, 5), 18: (58, 6), 12: (59, 6)}, 3, {"hours": 23, "minutes": 58, "seconds": 59}),
        (0x160200DD, 0o273, {20: (9, 4), 16: (12, 4)}, 0, {"satellites_used": 9, "satellites_visible": 12}),
        (0x160100FF, 0o377, {11: (4, 12)}, 0, {"data": 4, "sdi": 0}),
    ],
)
def test_values_times_and_bits_of_a_word_read_where_the_label_has_them(
    identifier: int,
    label: int,
    fields: dict[int, tuple[int, int]],
    ssm: int,
    said: dict[str, object],
    database: Database,
) -> None:
    frame = struct.pack("<II", word429(label, fields, ssm), 2**32 - 1)
    found = read(database, identifier, frame)
    assert said.items() <= found.items()
    assert found["bridge_time"] == 2**32 - 1


def test_heartbeats_of_every_channel_are_described(database: Database) -> None:
    for channel in (0, 1, 2, 8):
        counts = read(database, 0x16002000 + (channel << 16), struct.pack("<II", 2**32 - 1, 3))
        assert counts == {"words_received": 2**32 - 1, "words_lost": 3}


def test_only_the_frames_of_the_fd_radar_are_fd(database: Database) -> None:
    assert [one.name for one in database.messages if one.is_fd] == ["radar_0_segment_0"]
