"""Everything is numbered, written down and then passed on, in this order."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise

import pytest

from gateway import journal as journal_module
from gateway.adapters import stream
from gateway.journal import Journal
from gateway.queues import OVERHEAD_BYTES
from gateway.records import Note, Raw, Record, Stamp, Status, Tick
from tests.gateway.live import wait_until


class Log:
    """A keeper and a receiver that note who was called with what, in order."""

    figures = "as fast as can be"

    def __init__(self) -> None:
        self.calls: list[tuple[str, list[Record]]] = []
        self.revivals: list[str] = []

    def begin(self) -> None:
        self.calls.append(("begin", []))

    def keep(self, records: Sequence[Record]) -> None:
        self.calls.append(("keep", list(records)))

    def revive(self) -> str:
        return self.revivals.pop() if self.revivals else ""

    def deliver(self, records: Sequence[Record]) -> None:
        self.calls.append(("deliver", list(records)))

    def end(self) -> None:
        self.calls.append(("end", []))

    def wait_for(self, byte: int) -> None:
        """Wait until a chunk of this one byte was passed on."""
        chunk = bytes([byte])
        wait_until(lambda: any(isinstance(r, Raw) and r.data == chunk for r in self.delivered()), f"chunk {byte}")

    def delivered(self) -> list[Record]:
        """What was passed on, without the keeper's last word."""
        passed = [record for name, records in list(self.calls) if name == "deliver" for record in records]
        return [record for record in passed if not (isinstance(record, Status) and record.state == "CLOSED")]


def make(log: Log, limit_bytes: int = 1 << 20) -> Journal:
    return Journal(log, log.deliver, limit_bytes)  # type: ignore[arg-type] # as much as it needs


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
    (first, *between, last) = log.calls
    assert (first, last) == (("begin", []), ("end", []))
    names = [name for name, _ in between]
    assert names == ["keep", "deliver"] * (len(names) // 2)
    assert all(between[k][1] == between[k + 1][1] for k in range(0, len(names), 2))
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


def test_the_last_record_says_how_the_disk_did() -> None:
    log = Log()
    with running(journal := make(log)):
        journal.chunk("bridge", stream(b"x"))
    kept = [record for name, records in log.calls if name == "keep" for record in records]
    assert [type(record) for record in kept] == [Raw, Status]
    assert kept[-1][2:] == ("recording", "CLOSED", "as fast as can be")
    assert log.calls[-2] == ("deliver", kept[-1:])


def test_a_recording_that_goes_on_says_so_before_the_next_record() -> None:
    log = Log()
    journal = make(log)
    journal.chunk("bridge", stream(b"x"))
    log.revivals = ["7 records were not recorded"]
    with running(journal):
        log.wait_for(ord("x"))
    status, chunk = log.delivered()
    assert isinstance(chunk, Raw)
    assert (status.sequence, *status[2:]) == (0, "recording", "LOST", "7 records were not recorded")


def test_without_a_keeper_records_flow_all_the_same() -> None:
    passed: list[Record] = []
    keep: Callable[[list[Record]], None] = passed.extend
    with running(journal := Journal(None, keep, 1 << 20)):
        journal.chunk("bridge", stream(b"x"))
    assert [type(record) for record in passed] == [Raw]
