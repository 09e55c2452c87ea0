"""The journal: the one thread that numbers what happened, writes it down, and only then passes it on.

A record reaches the core after `write()` returned for it, so live order is file order. The journal never waits for the
core, and only for `write()` of the disk. When the disk fails the recording stops loudly, the records still flow to the
core, and the recording goes on once the disk is well.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from gateway.adapters import Reading
from gateway.queues import OVERHEAD_BYTES, ByteQueue
from gateway.recording.keeper import NAME, Keeper
from gateway.records import Note, Raw, Record, Stamp, Status, Tick

TICK_NS = 1_000_000_000
UTC_STEP_NS = 100_000_000  # a jump of UTC against the monotonic clock worth a note


@dataclass(frozen=True, slots=True)
class Chunk:
    """What an adapter hands over: bytes with the time of reading."""

    stamp: Stamp
    adapter: str
    data: bytes
    dropped_before: int


@dataclass(frozen=True, slots=True)
class Report:
    """A change of state on its way to becoming a status record."""

    stamp: Stamp
    adapter: str
    state: str
    reason: str


def now() -> Stamp:
    """Both clocks of the host."""
    return Stamp(time.monotonic_ns(), time.time_ns())


class Journal:
    """Takes chunks and reports from any thread; writes them; delivers them in order."""

    def __init__(self, keeper: Keeper | None, deliver: Callable[[list[Record]], None], limit_bytes: int) -> None:
        self.queue: ByteQueue[Chunk | Report] = ByteQueue(limit_bytes)
        self._keeper = keeper
        self._deliver = deliver
        self._dropped: dict[str, int] = {}
        self._sequence = 0
        self._last_tick_ns = time.monotonic_ns()
        self._utc_offset_ns: int | None = None

    def chunk(self, adapter: str, reading: Reading) -> None:
        """Take what an adapter's thread has read; without room it is dropped, and the next chunk says how much."""
        lost = self._dropped.get(adapter, 0) + reading.lost
        if self.queue.put(Chunk(now(), adapter, reading.data, lost), len(reading.data) + OVERHEAD_BYTES):
            self._dropped[adapter] = 0
        else:
            self._dropped[adapter] = lost + reading.units

    def report(self, adapter: str, state: str, reason: str = "") -> None:
        """Take a change of state from any thread; what the adapter had to drop is told first."""
        dropped = self._dropped.pop(adapter, 0)
        if dropped:
            self.queue.put(Chunk(now(), adapter, b"", dropped), 0)
        self.queue.put(Report(now(), adapter, state, reason), 0)

    def run(self) -> None:
        """The work of the journal's thread, until the queue is closed and empty."""
        if self._keeper:
            self._keeper.begin()
        while True:
            until_tick_ns = self._last_tick_ns + TICK_NS - time.monotonic_ns()
            items = self.queue.take(max(until_tick_ns, 0) / 1e9)
            if items is None:
                break
            if self._keeper and (said := self._keeper.revive()):
                items.insert(0, Report(now(), NAME, "LOST", said))
            self._write([self._numbered(item) for item in items] + self._time())
        if self._keeper:
            self._write([self._numbered(Report(now(), NAME, "CLOSED", self._keeper.figures))])
            self._keeper.end()

    def _write(self, records: list[Record]) -> None:
        if records:
            if self._keeper:
                self._keeper.keep(records)
            self._deliver(records)

    def _numbered(self, item: Chunk | Report) -> Record:
        sequence = self._next()
        if isinstance(item, Chunk):
            return Raw(sequence, item.stamp, item.adapter, item.data, item.dropped_before)
        return Status(sequence, item.stamp, item.adapter, item.state, item.reason)

    def _time(self) -> list[Record]:
        """A tick each second, and a note where UTC was stepped."""
        stamp = now()
        if stamp.monotonic_ns - self._last_tick_ns < TICK_NS:
            return []
        self._last_tick_ns = stamp.monotonic_ns
        records: list[Record] = [Tick(self._next(), stamp)]
        offset_ns = stamp.utc_ns - stamp.monotonic_ns
        if self._utc_offset_ns is not None and abs(offset_ns - self._utc_offset_ns) > UTC_STEP_NS:
            step_s = (offset_ns - self._utc_offset_ns) / 1e9
            records.append(Note(self._next(), stamp, f"UTC of the host stepped by {step_s:+.3f} s"))
        self._utc_offset_ns = offset_ns
        return records

    def _next(self) -> int:
        self._sequence += 1
        return self._sequence - 1
