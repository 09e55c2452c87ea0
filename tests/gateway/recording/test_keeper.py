"""Records are kept in files that follow each other without a gap, whatever the disk does meanwhile."""

import errno
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gateway.config import RecordingConfig
from gateway.errors import GatewayError
from gateway.journal import Journal
from gateway.recording import Recorder, Recording
from gateway.recording import keeper as keeper_module
from gateway.recording.keeper import Keeper
from gateway.recording.verify import verify
from gateway.records import Raw, Record
from simulators.outlets import PtyOutlet
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live, recorded_bytes, replayed, wait_until
from tests.gateway.made import raw
from tests.gateway.recording.disks import break_down, breaking_disk, fill, needs_mount, read_only, small_disk
from tests.gateway.test_journal import running

MIB = 1 << 20


class Bench:
    """A keeper, what it reported, and numbered chunks of 10 kB ten milliseconds apart."""

    def __init__(self, directory: Path, **settings: float) -> None:
        self.reports: list[tuple[str, str]] = []
        self.deaths: list[str] = []
        config = RecordingConfig.model_validate({"directory": directory, "reserve_mib": 0, **settings})
        self.keeper = Keeper(
            config, {"configuration": "{}"}, self._report, lambda name, error: self.deaths.append(f"{name}: {error}")
        )
        self.count = 0

    def _report(self, state: str, reason: str) -> None:
        self.reports.append((state, reason))

    @property
    def states(self) -> list[str]:
        return [state for state, _ in self.reports]

    def keep(self, count: int = 1) -> None:
        for _ in range(count):
            self.keeper.keep([raw(self.count, self.count / 100, bytes([self.count % 256]) * 10_000)])
            self.count += 1

    def kept(self) -> list[int]:
        return [record.sequence for record in Recording(self.keeper.path)]


@contextmanager
def bench(directory: Path, **settings: float) -> Iterator[Bench]:
    made = Bench(directory, **settings)
    made.keeper.begin()
    yield made
    made.keeper.end()
    assert made.deaths == []


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The keeper looks at its disk at every record."""
    monkeypatch.setattr(keeper_module, "LOOK_NS", 0)


def test_files_rotate_by_size_without_a_gap_and_each_opens_alone(tmp_path: Path) -> None:
    with bench(tmp_path, rotate_mib=0.1) as b:
        b.keep(60)
    recording = Recording(b.keeper.path)
    assert [record.sequence for record in recording] == list(range(60))
    assert len(recording.files) == 6
    session = b.keeper.path.stem
    assert [path.name for path in recording.files[:3]] == [
        f"{session}.mcap",
        f"{session}.0002.mcap",
        f"{session}.0003.mcap",
    ]
    alone: list[Record] = []
    for number, path in enumerate(recording.files, start=1):
        one = Recording([path])
        alone += list(one)
        assert one.metadata == {"configuration": "{}", "session": session, "file": str(number), "format": "2"}
        assert not one.torn
    assert len(alone) == 60
    assert verify(recording).problems == []
    assert [record.sequence for record in Recording(tmp_path)] == list(range(60))


@pytest.mark.parametrize(("minutes", "files"), [(0, 1), (0.1, 4)])
def test_files_rotate_by_time_or_not_at_all(tmp_path: Path, minutes: float, files: int) -> None:
    with bench(tmp_path, rotate_minutes=minutes) as b:
        for k in range(27):  # a second apart: from 0 to 6 s, 7 to 13, 14 to 20, and the rest
            b.keeper.keep([raw(k, float(k), b"")])
    assert len(Recording(b.keeper.path).files) == files


def test_the_next_file_is_open_before_the_last_is_closed_and_closing_holds_nothing_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closing, go_on = threading.Event(), threading.Event()

    class Slow(Recorder):
        def close(self) -> None:
            closing.set()
            assert go_on.wait(20)
            super().close()

    monkeypatch.setattr(keeper_module, "Recorder", Slow)
    with bench(tmp_path, rotate_mib=0.1) as b:
        b.keep(12)
        assert closing.wait(10)
        b.keep(40)
        assert b.kept() == list(range(52))
        go_on.set()
    assert verify(Recording(b.keeper.path)).problems == []


def test_waiting_for_the_disk_holds_nothing_up_and_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    syncing, go_on = threading.Event(), threading.Event()

    class Slow(Recorder):
        def sync(self) -> None:
            syncing.set()
            assert go_on.wait(20)
            super().sync()

    monkeypatch.setattr(keeper_module, "Recorder", Slow)
    with bench(tmp_path, sync_interval_s=0.01) as b:
        b.keep(1)
        assert syncing.wait(10)
        b.keep(30)
        assert b.kept() == list(range(31))
        threading.Event().wait(0.3)
        go_on.set()
        figures = b.keeper._syncer.figures
        wait_until(lambda: figures.count >= 2, "two synchronisations")
    assert figures.longest_ns >= 300_000_000
    assert figures.longest_exposed_ns >= figures.longest_ns
    assert figures.total_ns / figures.count <= figures.longest_ns
    assert f"{figures.count} syncs" in b.keeper.figures


def test_the_disk_is_asked_to_hold_the_data_at_the_stated_interval(tmp_path: Path) -> None:
    with bench(tmp_path, sync_interval_s=0.02) as b:
        b.keep(1)
        wait_until(lambda: b.keeper._syncer.figures.count >= 5, "five synchronisations")


@needs_mount
def test_a_start_below_the_reserve_names_directory_room_and_mend(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 4) as disk:
        with pytest.raises(GatewayError, match=r"cannot record to .*disk: 4\.0 MiB free, .* 8 MiB; make room, name"):
            Bench(disk, reserve_mib=8)
        assert [*disk.iterdir()] == []


@needs_mount
def test_a_start_or_a_rotation_on_a_full_disk_leaves_no_empty_file_and_may_be_tried_again(
    tmp_path: Path, impatient: None
) -> None:
    with small_disk(tmp_path / "disk", 1) as disk:
        ballast = fill(disk, 0)
        with pytest.raises(GatewayError, match=r"cannot record to .*\.mcap: No space left on device; choose another"):
            Bench(disk)
        assert [*disk.iterdir()] == [ballast]
        ballast.unlink()
        with bench(disk, rotate_mib=0.019) as b:
            b.keep(1)
            ballast = fill(disk, 3 * 4096)  # pages that the next record takes, and none for a file more
            b.keep(1)
            assert b.states == ["NOT_ROTATED"]
            ballast.unlink()
            b.keep(2)
            assert b.states == ["NOT_ROTATED"] and b.kept() == [0, 1, 2, 3]
        assert len(Recording(b.keeper.path).files) == 2


@needs_mount
def test_below_the_reserve_recording_stops_and_goes_on_in_a_new_file_when_there_is_room(
    tmp_path: Path, impatient: None
) -> None:
    with small_disk(tmp_path / "disk", 16) as disk, bench(disk, reserve_mib=2) as b:
        b.keep(20)
        ballast = fill(disk, MIB)
        b.keep(5)
        assert b.states == ["FAILED"]
        assert "MiB free, less than the reserve of 2 MiB; make room" in b.reports[0][1]
        assert b.keeper.revive() == ""
        ballast.unlink()
        said = b.keeper.revive()
        assert said.startswith("5 records were not recorded: ") and said.endswith(".0002.mcap")
        assert b.keeper.failure == ""
        b.keep(10)
        b.keeper.end()
        recording = Recording(b.keeper.path)
        assert [record.sequence for record in recording] == [*range(20), *range(25, 35)]
        assert recording.torn == "", "there was room for the index"
        assert b.keeper.lost == 5
        found = verify(recording)
        assert (found.count, found.missing) == (1, 5)
        b.keeper._syncer.stop = b.keeper.end = lambda: None  # type: ignore[method-assign] # has ended


@needs_mount
def test_a_full_disk_costs_the_batch_that_it_did_not_take(tmp_path: Path, impatient: None) -> None:
    with small_disk(tmp_path / "disk", 4) as disk, bench(disk) as b:
        b.keep(20)
        ballast = fill(disk, 0)
        b.keep(5)
        assert b.states == ["FAILED"]
        assert "No space left on device; make room" in b.keeper.failure
        assert b.kept() == list(range(b.count - b.keeper._missed))
        assert b.keeper.revive() == "", "less than a MiB of room would fail again at once"
        ballast.unlink()
        assert b.keeper.revive()
        b.keep(5)
        assert b.kept()[-5:] == list(range(20, 30))[-5:]


@needs_mount
def test_a_broken_disk_is_told_and_a_file_on_another_goes_on(tmp_path: Path, impatient: None) -> None:
    with breaking_disk(tmp_path / "disk") as disk:
        with bench(disk) as b:
            b.keep(20)
            break_down(disk)
            b.keep(5)
            assert b.states[0] == "FAILED"
            assert "Input/output error; see to the disk" in b.keeper.failure
            assert b.keeper.revive() == ""
        assert b.keeper.lost == 5 and b.keeper.failure


@needs_mount
def test_a_directory_that_forbids_new_files_lets_the_old_one_grow_and_is_told_once(
    tmp_path: Path, impatient: None
) -> None:
    directory = tmp_path / "recordings"
    with bench(directory, rotate_mib=0.1) as b:
        b.keep(5)
        with read_only(directory):
            b.keep(30)
            assert b.states == ["NOT_ROTATED"]
            assert "Read-only file system" in b.reports[0][1]
        b.keep(5)
    assert b.kept() == list(range(40))
    assert len(Recording(b.keeper.path).files) == 2


def test_a_removed_directory_is_noticed_made_anew_and_told(tmp_path: Path, impatient: None) -> None:
    directory = tmp_path / "recordings"
    with bench(directory) as b:
        b.keep(20)
        shutil.rmtree(directory)
        b.keep(3)
        assert b.states == ["FAILED"]
        assert "removed while it was written, and with it 20 records" in b.keeper.failure
        assert b.keeper.revive()
        b.keep(4)
    (path,) = directory.iterdir()
    assert [record.sequence for record in Recording([path])] == list(range(23, 27))


def test_a_failing_synchronisation_stops_the_recording(
    tmp_path: Path, impatient: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Failing(Recorder):
        def sync(self) -> None:
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(keeper_module, "Recorder", Failing)
    with bench(tmp_path, sync_interval_s=0.01) as b:
        b.keep(1)
        wait_until(lambda: b.keeper._sync_error, "a failed synchronisation")
        b.keep(1)
        assert b.states == ["FAILED"] and "Input/output error" in b.keeper.failure


def test_a_file_without_a_record_is_not_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(Recorder):
        def append(self, records: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(keeper_module, "Recorder", Full)
    with bench(tmp_path) as b:
        b.keep(3)
    assert [*tmp_path.iterdir()] == []
    assert b.keeper.lost == 3


def test_a_disk_that_has_no_room_for_the_index_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(Recorder):
        def close(self) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(keeper_module, "Recorder", Full)
    with bench(tmp_path) as b:
        b.keep(3)
    assert "No space left on device; make room" in b.keeper.failure
    assert b.kept() == [0, 1, 2]


def test_files_hold_what_was_passed_on_at_that_moment(tmp_path: Path) -> None:
    b = Bench(tmp_path, rotate_mib=0.001)
    agreed: list[bool] = []
    passed: list[Record] = []

    def deliver(records: list[Record]) -> None:
        passed.extend(records)
        agreed.append(list(Recording(b.keeper.path)) == passed)

    from gateway.adapters import stream

    journal = Journal(b.keeper, deliver, 1 << 20)
    with running(journal):
        for k in range(50):
            journal.chunk("bridge", stream(bytes(k)))
    assert agreed and all(agreed)
    assert len(Recording(b.keeper.path).files) > 1


@pytest.fixture
def line() -> Iterator[PtyOutlet]:
    with PtyOutlet() as outlet:
        yield outlet


def test_a_rotated_session_replays_as_it_was_live(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes, tmp_path: Path
) -> None:
    recording = {"directory": tmp_path / "recordings", "rotate_mib": 0.02}
    with Live(make_rack(f"serial:{line.path}", terrain=[TERRAIN], recording=recording)) as live:
        for start in range(0, len(stream), 5000):
            line.write(stream[start : start + 5000])
            live.wait_for_bytes(min(start + 5000, len(stream)))
        live.wait_for("integrity", 2)
    assert len(Recording(live.path).files) > 2
    assert recorded_bytes(live.path) == stream
    assert replayed(tmp_path / "recordings") == live.lines


@needs_mount
def test_live_a_full_disk_degrades_verdicts_until_there_is_room_and_the_loss_is_in_the_recording(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes, tmp_path: Path
) -> None:
    with small_disk(tmp_path / "disk", 4) as disk:
        recording = {"directory": disk, "reserve_mib": 1}
        live = Live(make_rack(f"serial:{line.path}", terrain=[TERRAIN], recording=recording))
        live.service.start()
        line.write(stream[:20_000])
        live.wait_for_bytes(20_000)
        ballast = fill(disk, 0)
        live.wait_for("status", adapter="recording", state="FAILED")
        line.write(stream[20_000:])
        live.wait_for("integrity", 2)
        ballast.unlink()
        live.wait_for("status", adapter="recording", state="LOST")
        line.write(stream)
        live.wait_for("integrity", 4)
        wait_until(lambda: recorded_bytes(live.path).endswith(stream), "the last bytes recorded")
        live.service.stop()
        reasons = [" ".join(event["reasons"]) for event in live.events("integrity")]
        assert any("degraded: recording FAILED: " in text for text in reasons)
        assert any("degraded: recording LOST: " in text for text in reasons)
        (lost,) = live.events("status", adapter="recording", state="LOST")
        missing = verify(Recording(live.path)).missing
        assert missing > 0 and lost["reason"].startswith(f"{missing} records were not recorded: ")
        assert live.service.failures == [f"recording: {missing} records were not recorded"]
        assert any("degraded: recording LOST" in text for text in replayed(live.path))


def test_every_chunk_is_either_recorded_or_counted(tmp_path: Path, impatient: None) -> None:
    with bench(tmp_path / "recordings") as b:
        for k in range(6):
            b.keep(7)
            if k % 2:
                shutil.rmtree(tmp_path / "recordings")
                b.keep(2)
                b.keeper.revive()
    assert b.states == ["FAILED"] * 3
    assert b.keeper.lost == 6
    assert all(isinstance(record, Raw) for record in Recording([*(tmp_path / "recordings").iterdir()]))
