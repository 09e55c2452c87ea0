"""The core thread's work: records to events, whatever happens.

A failure of the pipeline is reported (and so recorded) and the pipeline is built anew, so one bad record costs what it
interrupts and no more; the run ends with a non-zero exit all the same. A core that falls behind skips records, says how
many, and its next verdict says so; the recording stays whole.
"""

from collections.abc import Callable

from gateway.chunks import Block
from gateway.events import Event
from gateway.pipeline import Pipeline
from gateway.queues import OVERHEAD_BYTES, ByteQueue
from gateway.records import Raw, Record, Status

LIMIT_BYTES = 64 << 20

Emit = Callable[[Event], None]


class Core:
    """Runs records through a pipeline; when it fails, `build` makes its successor from it."""

    def __init__(self, build: Callable[[Pipeline | None], Pipeline], emit: Emit, report: Callable[[str], None]) -> None:
        self.failures = 0
        self._build = build
        self._emit = emit
        self._report = report
        self.unheard: Exception | None = None  # why events reach nobody any more
        self._pipeline = build(None)

    def process(self, record: Record) -> None:
        """Emit the events of one record."""
        try:
            for event in self._pipeline.feed(record):
                self._say(event)
        except Exception as error:  # noqa: BLE001 # a defect in decoding must not end the flight's monitoring
            self._failed(f"record {record.sequence}", error)
            self._pipeline = self._build(self._pipeline)

    def process_all(self, block: Block) -> None:
        """Emit the events of many records, the same as one by one; a failure costs the rest of them."""
        try:
            for event in self._pipeline.feed_all(block):
                self._say(event)
        except Exception as error:  # noqa: BLE001 # as in process
            self._failed(f"records {block.first.sequence} to {block.last.sequence}", error)
            self._pipeline = self._build(self._pipeline)

    def finish(self) -> None:
        """Emit what is left, and the summary."""
        try:
            for event in self._pipeline.finish():
                self._say(event)
        except Exception as error:  # noqa: BLE001 # as in process: told and counted, and the thread ends in order
            self._failed("end", error)

    def _say(self, event: Event) -> None:
        """Emit, until that fails: an event that told of it would fail again, and so on for ever."""
        if self.unheard:
            return
        try:
            self._emit(event)
        except Exception as error:  # noqa: BLE001 # whoever listens has left; recording and judging go on
            self.unheard = error
            self._failed("events reach nobody any more", error)

    def _failed(self, what: str, error: Exception) -> None:
        self.failures += 1
        self._report(f"{what}: {type(error).__name__}: {error}")


class CoreQueue:
    """Between the journal and the core: never makes the journal wait."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self.queue: ByteQueue[Record] = ByteQueue(LIMIT_BYTES)
        self._report = report
        self._skipped = 0

    def deliver(self, records: list[Record]) -> None:
        """Pass records on; those without room are skipped and reported once there is room again."""
        for record in records:
            size = len(record.data) + OVERHEAD_BYTES if isinstance(record, Raw) else 0
            if not self.queue.put(record, size):
                self._skipped += 1
            elif self._skipped and not isinstance(record, Status):  # or the report would report itself
                self._report(f"{self._skipped} records skipped")
                self._skipped = 0

    @property
    def skipped(self) -> int:
        """Records skipped and not yet reported, which at the end nobody reports any more."""
        return self._skipped

    def run(self, core: Core) -> None:
        """The work of the core's thread, until the queue is closed and empty."""
        while (records := self.queue.take()) is not None:
            for record in records:
                core.process(record)
        core.finish()
