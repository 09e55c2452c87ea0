"""Whatever one byte, a cut or inserted garbage do to a file: reading goes on, and says where the damage is.

Invariant of all of it: what is read was written, in its order; what is not read lies in a place that is told.
"""

import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.errors import GatewayError
from gateway.recording import Recorder, Recording
from gateway.recording import reader as reader_module
from gateway.recording.layout import MAGIC, Topic, parse_payload
from gateway.recording.window import Window
from gateway.records import Raw, Record
from tests.gateway.made import raw, some_records, tick
from tests.golden.make import HERE

METADATA = {"configuration": "{}", "host": "here"}
RECORDS: list[Record] = [*some_records(), *(raw(k, 2 + k, random.Random(k).randbytes(40)) for k in range(6, 12))]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A small recording that was closed."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    recorder = Recorder(path, METADATA)
    for record in RECORDS:
        recorder.append([record])
    recorder.close()
    return path.read_bytes()


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where changed files are written."""
    return tmp_path_factory.mktemp("changed") / "a.mcap"


def read(path: Path, data: bytes) -> tuple[list[Record], Recording]:
    path.write_bytes(data)
    recording = Recording(path)
    return list(recording), recording


def in_order(found: list[Record], written: list[Record]) -> bool:
    left = iter(written)
    return all(record in left for record in found)


def test_any_flipped_byte_costs_one_record_at_most_and_is_told(whole: bytes, place: Path) -> None:
    for at in range(len(whole)):
        data = bytearray(whole)
        data[at] ^= (0x01, 0x80, 0xFF)[at % 3]
        found, recording = read(place, bytes(data))
        assert recording.metadata == {**METADATA, "format": "2"}
        assert in_order(found, RECORDS) and len(found) >= len(RECORDS) - 1, at
        assert recording.damage or recording.torn, f"byte {at} is not noticed"
        assert recording.damaged <= 1
        for damage in recording.damage:
            assert damage.offset <= at < damage.offset + damage.length
            assert damage.what and damage.path == place


@given(st.data())
def test_a_flipped_byte_of_a_real_recording_costs_one_record_at_most(place: Path, data: st.DataObject) -> None:
    golden = (HERE / "format2.mcap").read_bytes()
    at = data.draw(st.integers(0, len(golden) - 1))
    changed = bytearray(golden)
    changed[at] ^= data.draw(st.integers(1, 255))
    found, recording = read(place, bytes(changed))
    assert in_order(found, WRITTEN) and len(found) >= len(WRITTEN) - 1
    assert recording.damage or recording.torn


WRITTEN = list(Recording(HERE / "format2.mcap"))


@given(size=st.integers(0, (HERE / "format2.mcap").stat().st_size - 1))
def test_a_real_recording_torn_anywhere_gives_a_prefix(place: Path, size: int) -> None:
    data = (HERE / "format2.mcap").read_bytes()[:size]
    try:
        found, recording = read(place, data)
    except GatewayError:
        assert size < 49
        return
    assert found == WRITTEN[: len(found)]
    assert recording.torn and not recording.damage
    if found and size < 90_000:
        assert "last one of 2026-05-28 20:26:" in recording.torn


GARBAGE = st.one_of(
    st.binary(max_size=300),
    st.lists(st.sampled_from([b"\x05", b"\x04", b"\x0c", b"\x0f", b"\0", b"\xff", MAGIC]), max_size=200).map(b"".join),
    st.builds(
        lambda length, rest: b"\x05" + length.to_bytes(8, "little") + rest, st.integers(0, 2**64 - 1), st.binary()
    ),
)


@given(at=st.integers(0, 2000), garbage=GARBAGE)
def test_inserted_garbage_costs_nothing_but_itself(whole: bytes, place: Path, at: int, garbage: bytes) -> None:
    at = min(at, len(whole))
    found, recording = read(place, whole[:at] + garbage + whole[at:])
    assert in_order(found, RECORDS) and len(found) >= len(RECORDS) - 1
    assert recording.damage or recording.torn or not garbage


@given(pieces=st.lists(st.tuples(st.integers(0, 2000), st.binary(min_size=1, max_size=60)), min_size=1, max_size=8))
def test_whatever_is_overwritten_what_is_read_was_written(
    whole: bytes, place: Path, pieces: list[tuple[int, bytes]]
) -> None:
    data = bytearray(whole)
    for at, piece in pieces:
        data[at : at + len(piece)] = piece
    try:
        found, _ = read(place, bytes(data))
    except GatewayError as error:
        assert str(place) in str(error)
        return
    assert in_order(found, RECORDS)


def test_format_1_goes_on_behind_damage_too(place: Path) -> None:
    golden = HERE / "format1.mcap"
    written = list(Recording(golden))
    data = bytearray(golden.read_bytes())
    chosen = random.Random(1)
    for at in (chosen.randrange(5000, len(data) - 2000) for _ in range(20)):
        damaged = data.copy()
        damaged[at] ^= 0xFF
        found, recording = read(place, bytes(damaged[:at]) + b"garbage" * 9 + bytes(damaged[at:]))
        assert in_order(found, written) and len(found) == len(written) - 1
        assert recording.damaged == 2, "the place, and the index whose offsets do not hold any more"


def test_damaged_places_are_kept_up_to_a_bound_and_all_counted(place: Path) -> None:
    recorder = Recorder(place.with_name("many.mcap"), METADATA)
    recorder.append([raw(k, k, b"a chunk of its own") for k in range(301)])
    recorder.close()
    data = bytearray(recorder.path.read_bytes())
    for match in list(re.finditer(b"a chunk", bytes(data)))[1::2]:
        data[match.start()] ^= 1
    found, recording = read(place, bytes(data))
    assert (len(found), recording.damaged, len(recording.damage)) == (151, 150, reader_module.KEPT_PLACES)


def hostile(length: int, count: int) -> bytes:
    """Heads of raw chunks that promise much and say the same in both places, so that only their CRC tells."""
    sequence, time = bytes(8), b"\x11" * 8
    head = b"\x05" + length.to_bytes(8, "little") + b"\x02\0" + sequence[:4] + time * 2
    return (head + b"\xde\xad\xbe\xef" + sequence + bytes(8) + time + bytes(4)) * count


CROWDS: dict[str, Callable[[], bytes]] = {
    "long heads": lambda: hostile((1 << 24) - 1, 40_000),
    "heads that end here": lambda: hostile(100_000, 40_000),
    "opcodes": lambda: b"\x05\x00\x00\x00" * 500_000,
    "channels": lambda: b"\x04\xff\xff\0\0\0\0\0\0" * 200_000,
    "zeros": lambda: bytes(3 << 20),
    "ends": lambda: (b"\x0f\x04" + bytes(11)) * 150_000,
}


@pytest.mark.parametrize("crowd", CROWDS)
def test_megabytes_of_plausible_garbage_cost_work_in_proportion(
    place: Path, crowd: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = place.with_name(f"{crowd}.mcap")
    recorder = Recorder(path, METADATA)
    first: list[Record] = [tick(0, 0), raw(1, 1, bytes(100)), tick(2, 2)]
    recorder.append(first)
    clean = path.read_bytes()
    recorder.append(last := [raw(k, k, bytes(60)) for k in range(3, 2000)])
    garbage = CROWDS[crowd]()
    path.write_bytes(clean + garbage + path.read_bytes()[len(clean) :] + bytes(1 << 21))
    spent, largest = [0], [0]

    def counted(topic: Topic, data: bytes) -> Record:
        spent[0] += len(data)
        return parse_payload(topic, data)

    class Watched(Window):
        def get(self, at: int, count: int) -> bytes:
            largest[0] = max(largest[0], len(self.data))
            return super().get(at, count)

    monkeypatch.setattr(reader_module, "parse_payload", counted)
    monkeypatch.setattr("gateway.recording.session.Window", Watched)
    found = list(Recording(path))
    assert found[:3] == first
    assert in_order(found[3:], [*last]) and len(found) > 1900
    assert isinstance(found[-1], Raw) and found[-1].sequence == 1999
    assert spent[0] <= 18 * len(garbage) + (64 << 20)
    assert largest[0] <= 20 << 20
