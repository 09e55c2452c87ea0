"""The files of a session: which belong to it, which are missed, and what is read of the rest."""

from pathlib import Path

import pytest

from gateway.config import check_config
from gateway.metadata import describe
from gateway.recording import Recorder, Recording
from gateway.recording.cutting import cut
from gateway.recording.recover import recover
from gateway.recording.session import file_of_session, sessions
from gateway.recording.verify import verify
from tests.gateway.made import raw, status, tick
from tests.gateway.recording.written import made
from tests.gateway.shell import within


def session(directory: Path, files: int) -> Path:
    """A session of files with two ticks each, closed as a gateway closes it."""
    directory.mkdir()
    first = directory / "s.mcap"
    describes = describe(check_config({"adapters": [{"name": "bridge", "source": "serial:x"}]}, "test"), None)
    for number in range(1, files + 1):
        recorder = Recorder(file_of_session(first, number), {**describes, "session": "s", "file": str(number)})
        recorder.append([tick(2 * number - 2, 2 * number), tick(2 * number - 1, 2 * number + 1)])
        if number == files:
            recorder.append([status(2 * files, 2 * files + 2, "CLOSED", adapter="recording")])
        recorder.close()
    return first


def test_a_missing_file_of_a_session_is_told(tmp_path: Path) -> None:
    for number, name in ((1, "a.mcap"), (2, "a.0002.mcap"), (4, "a.0004.mcap")):
        recorder = Recorder(tmp_path / name, {"session": "a", "file": str(number)})
        recorder.append([tick(number - 1, number)])
        recorder.close()
    found = verify(Recording(tmp_path / "a.mcap"))
    assert [text.partition(": ")[2] for text in found.problems] == [
        "it is file 4 of its session and follows file 2",
        "records 2 to 2 are missing",
    ]


@pytest.mark.parametrize("verb", ["replay", "dump", "export", "cut", "merge", "recover", "simulate"])
def test_a_file_that_a_session_lacks_is_told_by_each_command(verb: str, tmp_path: Path) -> None:
    first = session(tmp_path / "in", 4)
    file_of_session(first, 3).unlink()
    assert Recording(first).losses == []  # of what nobody has read yet
    out = tmp_path / "out.mcap"
    arguments: dict[str, list[str | Path]] = {
        "export": ["--to", "csv", "-o", out],
        "cut": ["-o", out],
        "merge": ["-o", out],
        "recover": ["-o", out],
        "simulate": ["--to", f"file:{out}"],
    }
    names = ["--from", first] if verb == "simulate" else [first]
    done = within(verb, *names, *arguments.get(verb, []))
    told = done.stdout + done.stderr
    assert "2 missing records" in told or "2 records are missing" in told, told
    assert done.returncode == (1 if verb == "replay" else 0)
    if verb == "merge":
        assert "s.mcap: 2 missing records" in Recording(out).metadata["merged"]


def test_the_first_files_and_the_last_ones_of_a_directory_are_missed_too(tmp_path: Path) -> None:
    first = session(tmp_path / "in", 4)
    whole = verify(Recording(tmp_path / "in"))
    assert (whole.problems, whole.remarks) == ([], ["record 8 says: recording CLOSED: "])
    file_of_session(first, 4).unlink()
    cut_short = verify(Recording(tmp_path / "in"))
    assert cut_short.problems == []
    assert cut_short.remarks == ["the session does not end here: its last record is none of its closing"]
    first.unlink()
    assert "records 0 to 1 are missing" in verify(Recording(tmp_path / "in")).problems[0]
    recording = Recording(tmp_path / "in")
    assert "2 records are missing" in recover(recording, iter(recording), tmp_path / "b.mcap")


def test_files_that_stand_in_the_wrong_order_are_told(tmp_path: Path) -> None:
    first = session(tmp_path / "in", 3)
    recording = Recording([first, file_of_session(first, 3), file_of_session(first, 2)])
    assert [record.sequence for record in recording] == [0, 1, 4, 5, 6, 2, 3]
    assert recording.losses == ["2 missing records", "1 step back in the order"]


@pytest.mark.parametrize("lost", [600, 2048, 4096, 8192])
def test_a_closed_recording_whose_beginning_is_lost_is_read_from_there_on(lost: int, tmp_path: Path) -> None:
    records = [raw(k, k, bytes([k % 256]) * 90, adapter=("bridge", "left")[k % 2]) for k in range(200)]
    whole = Recording(made(tmp_path / "a.mcap", [*records, tick(200, 200)]))
    spoilt = tmp_path / "b.mcap"
    spoilt.write_bytes(bytes(lost) + whole.path.read_bytes()[lost:])
    found = Recording(spoilt)
    assert found.metadata == whole.metadata
    rest = list(found)
    assert rest == [*records, tick(200, 200)][201 - len(rest) :]
    assert len(rest) > 100
    assert found.damaged == 1
    assert found.missing == 201 - len(rest)


def test_a_file_of_another_recording_is_none_that_follows_whatever_its_name(tmp_path: Path) -> None:
    session(tmp_path / "one", 1).rename(tmp_path / "flight.mcap")
    other = made(tmp_path / "flight.2026.mcap", [tick(0, 0)])
    cut_off = tmp_path / "flight.2027.mcap"
    cut(Recording(tmp_path / "flight.mcap"), iter(Recording(tmp_path / "flight.mcap")), None, None, cut_off)
    assert Recording(tmp_path / "flight.mcap").files == [tmp_path / "flight.mcap"]
    assert sessions(tmp_path.glob("*.mcap")) == [[tmp_path / "flight.mcap"], [other], [cut_off]]


def test_a_file_of_a_session_that_cannot_be_read_is_still_its_file(tmp_path: Path) -> None:
    first = session(tmp_path / "in", 3)
    second = file_of_session(first, 2)
    second.write_bytes(b"\x00" * 500)
    recording = Recording(first)
    assert recording.files == [first, second, file_of_session(first, 3)]
    assert len(list(recording)) == 5
    assert recording.losses == ["2 missing records"]


def test_a_session_whose_first_file_is_gone_is_read_from_the_next_on(tmp_path: Path) -> None:
    for number, name in ((2, "a.0002.mcap"), (3, "a.0003.mcap")):
        recorder = Recorder(tmp_path / name, {"session": "a", "file": str(number)})
        recorder.append([tick(number, number)])
        recorder.close()
    assert [record.sequence for record in Recording(tmp_path)] == [2, 3]


def test_a_session_is_recovered_as_one_file(tmp_path: Path) -> None:
    for number, name in ((1, "a.mcap"), (2, "a.0002.mcap")):
        Recorder(tmp_path / name, {"session": "a", "file": str(number)}).append([tick(number - 1, number)])
    recording = Recording(tmp_path / "a.mcap")
    recover(recording, iter(recording), tmp_path / "b.mcap")
    assert [record.sequence for record in Recording(tmp_path / "b.mcap")] == [0, 1, 2]
