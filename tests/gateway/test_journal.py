"""Everything is numbered, written down and then passed on, in this order."""

import errno
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from gateway import journal as journal_module
from gateway.adapters import stream
from gateway.journal import Journal
from gateway.queues import OVERHEAD_BYTES
from gateway.recording import Recorder
from gateway.records import Note, Raw, Record, Stamp, Status, Tick
from tests.gateway.live import wait_until


class Log:
    """A recorder and a receiver that note who was called with what, in order."""

    path = Path("log.mcap")

    def __init__(self) -> None:
        self.calls: list[tuple[str, list[Record]]] = []

    def append(self, records: Sequence[Record]) -> None:
        self.calls.append(("append", list(records)))

    def deliver(self, records: Sequence[Record]) -> None:
        self.calls.append(("deliver", list(records)))

    def sync(self) -> None:
        self.calls.append(("sync", []))

    def close(self) -> None:
        self.calls.append(("close", []))

    def abandon(self) -> None:
        self.calls.append(("abandon", []))

    def wait_for(self, byte: int) -> None:
        """Wait until a chunk of this one byte was passed on."""
        chunk = bytes([byte])
        wait_until(lambda: any(isinstance(r, Raw) and r.data == chunk for r in self.delivered()), f"chunk {byte}")

    def delivered(self) -> list[Record]:
        return [record for name, records in list(self.calls) if name == "deliver" for record in records]


def make(log: Log, limit_bytes: int = 1 << 20, sync_interval_s: float = 60.0) -> Journal:
    return Journal(log, log.deliver, limit_bytes, sync_interval_s)  # type: ignore[arg-type] # as much as it needs


@contextmanager
def running(journal: Journal) -> Iterator[None]:
    thread = threading.Thread(target=journal.run)
    thread.start()
    yield
    journal.queue.close()
    thread.join(10)
    assert not thread.is_alive()


def test_records_are_written_before_they_are_passed_on() -> None:
    log = Log()
    with running(journal := make(log)):
        for k in range(200):
            journal.chunk("bridge", stream(bytes([k])))
    assert log.calls.pop() == ("close", [])
    names = [name for name, _ in log.calls]
    assert names == ["append", "deliver"] * (len(names) // 2)
    assert all(log.calls[k][1] == log.calls[k + 1][1] for k in range(0, len(names), 2))
    assert b"".join(record.data for record in log.delivered() if isinstance(record, Raw)) == bytes(range(200))


def test_records_are_numbered_in_order_whatever_their_kind() -> None:
    log = Log()
    with running(journal := make(log)):
        journal.report("bridge", "UP", "why")
        journal.chunk("bridge", stream(b"a"))
        journal.chunk("other", stream(b"b"))
        journal.report("bridge", "LOST")
    assert [record.sequence for record in log.delivered()] == [0, 1, 2, 3]
    assert [type(record) for record in log.delivered()] == [Status, Raw, Raw, Status]


def test_a_full_queue_drops_the_newest_bytes_and_the_next_chunk_of_that_adapter_says_how_many() -> None:
    log = Log()
    journal = make(log, limit_bytes=10 + 2 * OVERHEAD_BYTES)
    journal.chunk("bridge", stream(b"12345678"))
    journal.chunk("bridge", stream(b"lost"))
    journal.chunk("bridge", stream(b"gone"))
    journal.chunk("other", stream(b"9"))
    with running(journal):
        wait_until(lambda: len(log.delivered()) == 2, "the queue is empty")
        journal.chunk("bridge", stream(b"later"))
        journal.chunk("bridge", stream(b"last"))
    found = [(r.adapter, r.data, r.dropped_before) for r in log.delivered() if isinstance(r, Raw)]
    assert found == [("bridge", b"12345678", 0), ("other", b"9", 0), ("bridge", b"later", 8), ("bridge", b"last", 0)]


def test_a_tick_comes_each_second_without_any_traffic(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_module, "TICK_NS", 50_000_000)
    log = Log()
    with running(make(log)):
        wait_until(lambda: len(log.delivered()) >= 4, "four ticks")
    ticks = log.delivered()
    assert all(isinstance(record, Tick) for record in ticks)
    steps = [b.stamp.monotonic_ns - a.stamp.monotonic_ns for a, b in pairwise(ticks)]
    assert min(steps) >= 50_000_000


@pytest.mark.parametrize(("step_ns", "said"), [(0, []), (50_000_000, []), (-3_600_000_000_000, ["-3600.000 s"])])
def test_a_step_of_utc_is_noted_beside_the_tick(monkeypatch: pytest.MonkeyPatch, step_ns: int, said: list[str]) -> None:
    monkeypatch.setattr(journal_module, "TICK_NS", 20_000_000)
    log, true_now, step = Log(), journal_module.now, [0]

    def now() -> Stamp:
        stamp = true_now()
        return Stamp(stamp.monotonic_ns, stamp.utc_ns + step[0])

    monkeypatch.setattr(journal_module, "now", now)
    with running(make(log)):
        wait_until(lambda: len(log.delivered()) >= 2, "two ticks")
        step[0] = step_ns
        before = len(log.delivered())
        wait_until(lambda: len(log.delivered()) >= before + 4, "four more records")
    notes = [record.text for record in log.delivered() if isinstance(record, Note)]
    assert notes == [f"UTC of the host stepped by {text}" for text in said]


def test_the_disk_is_asked_to_hold_the_data_at_the_stated_interval() -> None:
    log = Log()
    with running(journal := make(log, sync_interval_s=1e-9)):
        for k in range(3):
            journal.chunk("bridge", stream(bytes([k])))
            log.wait_for(k)
    names = [name for name, _ in log.calls]
    assert names == ["append", "sync", "deliver"] * (len(names) // 3) + ["close"]


class Failing(Log):
    """A recorder whose disk fails at the third append, at the first synchronisation, or when it is closed."""

    def __init__(self, failure: str) -> None:
        super().__init__()
        self._failure = failure

    def append(self, records: Sequence[Record]) -> None:
        super().append(records)
        if self._failure == "append" and sum(name == "append" for name, _ in self.calls) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        super().close()
        if self._failure == "close":
            raise OSError(errno.ENOSPC, "No space left on device")

    def sync(self) -> None:
        super().sync()
        if self._failure == "sync":
            raise OSError(errno.EIO, "Input/output error")


@pytest.mark.parametrize(("failure", "reason"), [("append", "No space left"), ("sync", "Input/output error")])
def test_a_failing_disk_stops_the_recording_and_says_so_while_records_flow_on(failure: str, reason: str) -> None:
    log = Failing(failure)
    with running(journal := make(log, sync_interval_s=1e-9 if failure == "sync" else 60)):
        for k in range(20):
            journal.chunk("bridge", stream(bytes([k])))
            log.wait_for(k)
    assert b"".join(record.data for record in log.delivered() if isinstance(record, Raw)) == bytes(range(20))
    failed = [record for record in log.delivered() if isinstance(record, Status)]
    assert [(record.adapter, record.state) for record in failed] == [("recording", "FAILED")]
    assert reason in failed[0].reason and "make room" in failed[0].reason
    assert journal.recording_error == failed[0].reason
    names = [name for name, _ in log.calls]
    assert names.count("abandon") == 1 and "close" not in names
    assert "append" not in names[names.index("abandon") :]


def test_a_disk_that_has_no_room_for_the_index_is_told() -> None:
    log = Failing("close")
    with running(journal := make(log)):
        journal.chunk("bridge", stream(b"x"))
    assert "No space left on device; make room" in journal.recording_error
    assert [name for name, _ in log.calls] == ["append", "deliver", "close", "abandon"]


def test_sequences_stay_unique_across_a_failing_disk() -> None:
    log = Failing("append")
    with running(journal := make(log)):
        for k in range(10):
            journal.chunk("bridge", stream(bytes([k])))
            log.wait_for(k)
    sequences = [record.sequence for record in log.delivered()]
    assert sequences == list(range(len(sequences)))


def test_a_real_recorder_holds_what_was_passed_on_at_that_moment(tmp_path: Path) -> None:
    from gateway.recording import Recording

    recorder = Recorder(tmp_path / "a.mcap", {})
    agreed: list[bool] = []
    passed: list[Record] = []

    def deliver(records: list[Record]) -> None:
        passed.extend(records)
        agreed.append(list(Recording(tmp_path / "a.mcap")) == passed)

    journal = Journal(recorder, deliver, 1 << 20)
    with running(journal):
        for k in range(50):
            journal.chunk("bridge", stream(bytes(k)))
    assert agreed and all(agreed)


def test_without_a_recorder_records_flow_all_the_same() -> None:
    passed: list[Record] = []
    keep: Callable[[list[Record]], None] = passed.extend
    with running(journal := Journal(None, keep, 1 << 20)):
        journal.chunk("bridge", stream(b"x"))
    assert [type(record) for record in passed] == [Raw]
