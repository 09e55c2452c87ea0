"""Raw records are read many at once; nothing of that shows, wherever a block ends or a byte is wrong."""

import random
from collections import Counter
from itertools import islice
from pathlib import Path

import pytest

from gateway.recording import Recorder, Recording
from gateway.recording import reader as reader_module
from gateway.recording.kernels import RAW_BYTES
from gateway.recording.layout import Topic, parse_payload
from gateway.records import Raw, Record, Stamp
from tests.gateway.made import raw, status, tick

CHOSEN = random.Random(4)
RAWS = [
    raw(k, k / 100, CHOSEN.randbytes(CHOSEN.choice((0, 1, 15, 40, 200, 700))), CHOSEN.choice((0, 0, 9)), adapter)
    for k, adapter in enumerate(CHOSEN.choices(("left", "right", "can"), k=120), 1)
]
RECORDS: list[Record] = [
    tick(0, 0),
    *RAWS,
    tick(121, 2),
    raw(122, 2, b"a"),
    status(123, 2, "LOST"),
    raw(124, 2, bytes(range(50))),
]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A closed recording of them."""
    return recorded(tmp_path_factory.mktemp("reading") / "a.mcap", RECORDS)


def recorded(path: Path, records: list[Record]) -> Path:
    recorder = Recorder(path, {})
    recorder.append(records)
    recorder.close()
    return path


def test_raw_records_behind_the_first_one_are_read_by_the_compiled_loop(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    singly: Counter[str] = Counter()

    def counted(topic: Topic, data: bytes) -> Record:
        singly[topic.name] += 1
        return parse_payload(topic, data)

    recording = Recording(path)
    monkeypatch.setattr(reader_module, "parse_payload", counted)
    assert list(recording) == RECORDS
    assert singly == {f"/raw/{RAWS[0].adapter}": 1, "/tick": 2, "/status": 1}


@pytest.mark.parametrize("at_once", [1, 2, 7, 4096])
def test_it_does_not_matter_how_many_are_read_at_once(
    path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    monkeypatch.setattr(reader_module, "AT_ONCE", at_once)
    recording = Recording(path)
    assert list(recording) == RECORDS
    assert (recording.records, recording.damaged, recording.torn) == (len(RECORDS), 0, "")


def test_a_block_may_end_anywhere_in_a_record(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for block in range(1, 900, 13):
        monkeypatch.setattr("gateway.recording.window.BLOCK", block)
        assert list(Recording(path)) == RECORDS, block


@pytest.mark.parametrize(("block", "step"), [(97, 7), (1000, 2), (1 << 19, 3)])
def test_a_damaged_byte_anywhere_in_a_run_costs_its_own_record(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int, step: int
) -> None:
    monkeypatch.setattr("gateway.recording.window.BLOCK", block)
    data, changed = path.read_bytes(), tmp_path / "changed.mcap"
    begin = next(data.index(record.data) - RAW_BYTES for record in RAWS[40:] if len(record.data) > 40)
    for at in range(begin, begin + 1500, step):
        damaged = bytearray(data)
        damaged[at] ^= 1 << at % 8
        changed.write_bytes(damaged)
        recording = Recording(changed)
        found = list(recording)
        (lost,) = [record for record in RECORDS if record not in found]
        (place,) = recording.damage
        assert isinstance(lost, Raw)
        assert (recording.records, place.length) == (len(RECORDS) - 1, RAW_BYTES + len(lost.data)), at
        assert place.offset <= at < place.offset + place.length


def test_who_stops_early_is_told_how_many_records_there_were(path: Path) -> None:
    recording = Recording(path)
    for count in (1, 2, 50, len(RAWS) + 2, len(RECORDS)):
        assert list(islice(recording, count)) == RECORDS[:count]
        assert recording.records == count


def test_a_torn_end_names_the_last_record_whether_it_came_in_a_run_or_not(path: Path, tmp_path: Path) -> None:
    data, torn = path.read_bytes(), tmp_path / "torn.mcap"
    for record in (*RAWS[50:60], RECORDS[-1]):
        if isinstance(record, Raw) and len(record.data) > 40:
            torn.write_bytes(data[: data.index(record.data) + len(record.data) - 1])
            recording = Recording(torn)
            found = list(recording)
            assert found == RECORDS[: record.sequence]
            last = f"{found[-1].stamp.utc_ns // 1000 % 10**6:06d} UTC"
            assert f"after {len(found)} records" in recording.torn and last in recording.torn


def test_a_file_that_grows_is_read_as_far_as_it_was_when_reading_began(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {})
    recorder.append(RECORDS[:60])
    recording = Recording(recorder.path)
    records = iter(recording)
    assert next(records) == RECORDS[0]
    recorder.append(RECORDS[60:])
    assert [RECORDS[0], *records] == RECORDS[:60]
    assert "after 60 records" in recording.torn
    assert list(recording) == RECORDS
    recorder.close()
    assert list(recording) == RECORDS and not recording.torn


def test_the_largest_numbers_of_the_format_come_back_as_they_were(tmp_path: Path) -> None:
    largest = [Raw(2**64 - 3 + k, Stamp(2**64 - 1, 2**64 - 2), "bridge", b"x" * k, 2**32 - 1) for k in range(3)]
    assert list(Recording(recorded(tmp_path / "a.mcap", [*largest]))) == largest


def test_records_of_any_number_of_adapters_have_their_own(tmp_path: Path) -> None:
    many: list[Record] = [raw(k, k, b"chunk", adapter=f"adapter {k % 300}") for k in range(1200)]
    assert list(Recording(recorded(tmp_path / "a.mcap", many))) == many
