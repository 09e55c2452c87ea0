"""A core that survives what it decodes, what listens to it, and being too slow."""

from collections.abc import Iterator, Set

import pytest

from gateway import core as core_module
from gateway.core import Core, CoreQueue
from gateway.events import Event, StatusEvent
from gateway.queues import OVERHEAD_BYTES
from gateway.records import Raw, Record
from tests.gateway.made import raw, stamp, status, tick


class Parrot:
    """A pipeline that repeats each record's number, and fails at some."""

    def __init__(self, fails_at: Set[int], fails_at_the_end: bool = False) -> None:
        self._fails_at = fails_at
        self._fails_at_the_end = fails_at_the_end

    def feed(self, record: Record) -> Iterator[Event]:
        if record.sequence in self._fails_at:
            raise ZeroDivisionError("defect")
        yield StatusEvent(record.stamp.utc_ns, record.sequence, "parrot", "SAYS", "")

    def finish(self) -> Iterator[Event]:
        if self._fails_at_the_end:
            raise ZeroDivisionError("defect")
        yield StatusEvent(0, -1, "parrot", "ENDS", "")


class Heard:
    """Who listens: it keeps sequences, and stops listening after some."""

    def __init__(self, limit: int = 1000) -> None:
        self.sequences: list[int] = []
        self.calls = 0
        self._limit = limit

    def __call__(self, event: Event) -> None:
        self.calls += 1
        if len(self.sequences) >= self._limit:
            raise BrokenPipeError(32, "Broken pipe")
        self.sequences.append(event.sequence)


def make(
    heard: Heard, *, fails_at: Set[int] = frozenset(), at_the_end: bool = False
) -> tuple[Core, list[str], list[Parrot]]:
    reports: list[str] = []
    built: list[Parrot] = []

    def build(before: Parrot | None) -> Parrot:
        assert before is (built[-1] if built else None)
        built.append(Parrot(fails_at, at_the_end))
        return built[-1]

    return Core(build, heard, reports.append), reports, built  # type: ignore[arg-type] # as much of a pipeline as it needs


def test_a_record_that_breaks_the_pipeline_costs_itself_and_is_reported() -> None:
    heard = Heard()
    core, reports, built = make(heard, fails_at={2})
    for k in range(5):
        core.process(tick(k, k))
    core.finish()
    assert heard.sequences == [0, 1, 3, 4, -1]
    assert reports == ["record 2: ZeroDivisionError: defect"]
    assert core.failures == 1
    assert len(built) == 2


def test_a_pipeline_that_breaks_at_the_end_is_reported() -> None:
    core, reports, _ = make(Heard(), at_the_end=True)
    core.finish()
    assert core.failures == 1
    assert "ZeroDivisionError" in reports[0]


def test_a_listener_that_has_left_is_reported_once_and_not_asked_again() -> None:
    heard = Heard(limit=3)
    core, reports, built = make(heard)
    for k in range(100):
        core.process(tick(k, k))
    core.finish()
    assert heard.sequences == [0, 1, 2]
    assert heard.calls == 4
    assert core.failures == len(reports) == 1
    assert "BrokenPipeError" in reports[0]
    assert len(built) == 1


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core_module, "LIMIT_BYTES", 2 * (40 + OVERHEAD_BYTES) + 20)


def test_a_core_that_falls_behind_skips_the_newest_and_says_how_many(small: None) -> None:
    reports: list[str] = []
    queue = CoreQueue(reports.append)
    queue.deliver([raw(k, k, bytes(40)) for k in range(5)])
    assert reports == []
    first = queue.queue.take() or []
    queue.deliver([raw(5, 5, bytes(40))])
    assert reports == ["3 records skipped"]
    queue.deliver([raw(6, 6, bytes(40))])
    assert reports == ["3 records skipped"]
    taken = [record.sequence for record in first + (queue.queue.take() or [])]
    assert taken == [0, 1, 5, 6]


def test_statuses_and_ticks_reach_a_core_that_is_behind(small: None) -> None:
    queue = CoreQueue(lambda _: None)
    queue.deliver([raw(0, 0, bytes(100)), raw(1, 0, bytes(1)), status(2, 0, "LOST"), tick(3, 1)])
    assert [record.sequence for record in queue.queue.take() or []] == [0, 2, 3]


def test_what_was_skipped_before_a_silence_is_told_at_the_next_tick(small: None) -> None:
    reports: list[str] = []
    queue = CoreQueue(reports.append)
    queue.deliver([raw(0, 0, bytes(100)), raw(1, 0, bytes(1))])
    queue.deliver([tick(2, 1)])
    assert reports == ["1 records skipped"]


def test_a_skip_that_is_reported_does_not_report_itself(small: None) -> None:
    reports: list[str] = []
    queue = CoreQueue(reports.append)
    queue.deliver([raw(0, 0, bytes(100)), raw(1, 0, bytes(1)), status(2, 0, "BEHIND", adapter="core")])
    assert reports == []


def test_the_queue_runs_a_core_until_it_is_closed_and_empty() -> None:
    heard = Heard()
    core, _, _ = make(heard)
    queue = CoreQueue(lambda _: None)
    queue.deliver([Raw(k, stamp(k), "bridge", b"x") for k in range(4)])
    queue.queue.close()
    queue.run(core)
    assert heard.sequences == [0, 1, 2, 3, -1]
