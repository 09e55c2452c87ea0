"""A recording holds what was appended, whatever happens to its end."""

import contextlib
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader

from gateway.errors import GatewayError
from gateway.recording import Recorder, Recording
from gateway.records import Raw, Record
from tests.gateway.made import raw, some_records, status, tick

METADATA = {"configuration": "{}", "host": "here"}


@pytest.fixture
def closed(tmp_path: Path) -> Path:
    """A small recording that was closed."""
    path = tmp_path / "closed.mcap"
    recorder = Recorder(path, METADATA)
    for record in some_records():
        recorder.append([record])
    recorder.close()
    return path


def changed(path: Path, data: bytes) -> Recording:
    path.write_bytes(data)
    return Recording(path)


def test_a_closed_recording_gives_every_record_in_order(closed: Path) -> None:
    recording = Recording(closed)
    assert list(recording) == some_records()
    assert recording.metadata == {**METADATA, "format": "2"}
    assert (recording.records, recording.damaged, recording.torn) == (6, 0, "")


def test_a_recording_can_be_read_again(closed: Path) -> None:
    recording = Recording(closed)
    assert list(recording) == list(recording)
    assert recording.records == 6


def test_what_append_returned_for_is_on_disk_without_close(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "open.mcap", METADATA)
    kept: list[Record] = []
    for k in range(500):
        batch: list[Record] = [raw(2 * k, k, bytes(97)), tick(2 * k + 1, k)]
        recorder.append(batch)
        kept += batch
        if k % 100 == 0:
            recording = Recording(tmp_path / "open.mcap")
            assert list(recording) == kept
            assert recording.torn
    assert list(Recording(tmp_path / "open.mcap")) == kept
    recorder.close()
    assert list(Recording(tmp_path / "open.mcap")) == kept


def test_any_mcap_tool_opens_a_closed_recording(closed: Path) -> None:
    with closed.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        messages = [(channel.topic, message.data) for _, channel, message in reader.iter_messages()]
    assert summary is not None and summary.statistics is not None
    assert {channel.topic for channel in summary.channels.values()} == {
        "/status",
        "/raw/bridge",
        "/raw/left-2",
        "/note",
        "/tick",
    }
    assert summary.statistics.message_count == len(messages) == 6


def test_the_layout_is_as_our_page_has_it(closed: Path) -> None:
    with closed.open("rb") as file:
        messages = list(make_reader(file).iter_messages())
    for (_, channel, message), record in zip(messages, some_records(), strict=True):
        if isinstance(record, Raw):
            crc, *fields = struct.unpack_from("<IQQQI", message.data)
            assert crc == zlib.crc32(channel.topic.encode() + message.data[4:])
            assert [*fields, message.data[32:]] == [record.sequence, *record.stamp, record.dropped_before, record.data]
        else:
            text, _, crc_text = message.data.rpartition(b',"crc32":')
            assert crc_text == b"%d}" % zlib.crc32(channel.topic.encode() + text)
            assert json.loads(message.data)["stamp"] == record.stamp._asdict()
        assert (message.sequence, message.log_time, message.publish_time) == (
            record.sequence,
            *[record.stamp.utc_ns] * 2,
        )


def test_the_mcap_library_reads_a_torn_recording_up_to_the_tear(closed: Path, tmp_path: Path) -> None:
    data = closed.read_bytes()
    second = data.index(bytes(range(256)))
    torn = tmp_path / "torn.mcap"
    for size, whole in ((second + 100, 1), (second + 300, 2), (len(data) - 200, 6)):
        torn.write_bytes(data[:size])
        found: list[bytes] = []
        with torn.open("rb") as file, contextlib.suppress(McapError, struct.error):
            for _, _, message in NonSeekingReader(file).iter_messages(log_time_order=False):
                found.append(message.data)
        assert len(found) >= whole
        assert len(list(Recording(torn))) >= whole


def test_a_closed_recording_has_its_index_on_disk(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", METADATA)
    recorder.append([tick(0, 0.0)])
    recorder.close()
    data = recorder.path.read_bytes()
    assert data.endswith(b"\x89MCAP0\r\n") and data.count(b"\x89MCAP0\r\n") == 2
    assert recorder.size == len(data)


def test_nothing_grows_in_memory_with_the_records(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", METADATA)
    for k in range(3000):
        recorder.append([raw(2 * k, 0.0, b"x"), tick(2 * k + 1, 0.0)])
    held = [thing for thing in vars(recorder._writer).values() if isinstance(thing, list | dict)]
    assert len(held) > 5 and max(map(len, held)) <= 2, "the MCAP writer keeps nothing but its channels"
    recorder.abandon()


def test_a_record_larger_than_any_may_be_is_refused(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", METADATA)
    with pytest.raises(ValueError, match="record 3 of 16777248 bytes is larger"):
        recorder.append([raw(3, 0.0, bytes(16 << 20))])
    recorder.abandon()


def test_a_directory_stands_for_its_only_session_and_a_list_for_itself(closed: Path, tmp_path: Path) -> None:
    assert list(Recording(tmp_path)) == some_records()
    second = Recorder(tmp_path / "other.mcap", METADATA)
    second.append([tick(0, 0.0)])
    second.close()
    with pytest.raises(GatewayError, match=r"a directory with 2 recordings: name one \(closed.mcap, other.mcap\)"):
        Recording(tmp_path)
    assert list(Recording([closed, second.path])) == [*some_records(), tick(0, 0.0)]


def test_a_later_format_is_named(closed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gateway.recording import layout

    monkeypatch.setattr(layout, "FORMAT", "3")
    entries = layout.guarded("shadebus", METADATA)
    monkeypatch.undo()
    assert entries["format"] == "3"
    monkeypatch.setattr("gateway.recording.writer.guarded", lambda *_: entries)
    recorder = Recorder(closed.with_name("later.mcap"), METADATA)
    recorder.abandon()
    with pytest.raises(GatewayError, match=r"is of format 3, .* update shadebus"):
        Recording(recorder.path)


def test_a_recording_torn_anywhere_gives_a_prefix_and_says_so(closed: Path, tmp_path: Path) -> None:
    data = closed.read_bytes()
    counts: list[int] = []
    for size in range(0, len(data), 3):
        try:
            recording = changed(tmp_path / "torn.mcap", data[:size])
        except GatewayError as error:
            assert "is not a shadebus recording" in str(error)
            assert not counts, "a longer piece was readable before"
            continue
        found = list(recording)
        assert found == some_records()[: len(found)]
        assert recording.records == len(found)
        assert recording.torn, f"{size} of {len(data)} bytes"
        assert recording.damaged == 0
        counts.append(len(found))
    assert counts == sorted(counts)
    assert set(counts) == set(range(7))


def test_a_changed_byte_in_a_raw_chunk_costs_that_record_and_is_counted(closed: Path, tmp_path: Path) -> None:
    data = bytearray(closed.read_bytes())
    data[data.index(bytes(range(256))) + 7] ^= 1
    recording = changed(tmp_path / "damaged.mcap", bytes(data))
    assert list(recording) == [record for record in some_records() if record.sequence != 1]
    assert (recording.records, recording.damaged, recording.torn) == (5, 1, "")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, "cannot read recording .*: No such file"),
        (lambda path: path.mkdir(), "is a directory with 0 recordings: name one"),
        (lambda path: path.write_bytes(b""), "is not a shadebus recording: it ends before its first record"),
        (lambda path: path.write_text("hello, this is text\n" * 50), "is not a shadebus recording"),
        (lambda path: path.write_bytes(bytes(1000)), "is not a shadebus recording"),
    ],
)
def test_what_is_no_recording_is_named(tmp_path: Path, make: Callable[[Path], object], message: str) -> None:
    path = tmp_path / "what.mcap"
    make(path)
    with pytest.raises(GatewayError, match=message) as caught:
        Recording(path)
    assert str(path) in str(caught.value)


def test_a_recording_is_never_written_over(closed: Path) -> None:
    before = closed.read_bytes()
    with pytest.raises(GatewayError, match="File exists"):
        Recorder(closed, METADATA)
    assert closed.read_bytes() == before


def test_a_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(GatewayError, match=r"cannot record to .*file.*; choose another directory"):
        Recorder(tmp_path / "file" / "a.mcap", METADATA)


def test_an_abandoned_recording_keeps_what_it_accepted(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", METADATA)
    recorder.append([status(0, 0, "UP")])
    recorder.abandon()
    recording = Recording(tmp_path / "a.mcap")
    assert list(recording) == [status(0, 0, "UP")]
    assert recording.torn
