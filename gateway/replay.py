"""Replay: the records of a file through the same core as live."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import groupby, islice

from gateway.chunks import Block
from gateway.config import RackConfig
from gateway.core import Core, Emit
from gateway.errors import GatewayError
from gateway.events import Event, IntegrityEvent, ScanEvent
from gateway.pipeline import Pipeline, Watcher
from gateway.recording import Recording
from gateway.recording.cutting import in_order
from gateway.records import Raw, Record, Status
from monitor.integrity import Monitor

RECORDS_AT_ONCE = 256  # as fast as possible

Wait = Callable[[threading.Event], None]


def replay(
    recording: Recording,
    config: RackConfig,
    monitor: Monitor | None,
    emit: Emit,
    report: Callable[[str], None],
    *,
    watcher: Watcher | None = None,
    speed: float | None = None,
    start_s: float = 0.0,
    stop_s: float | None = None,
    stop: threading.Event | None = None,
    names: Mapping[str, str] | None = None,
    step: Wait | None = None,
) -> int:
    """Emit the events of a recording, as fast as possible or at `speed` times real time; return the core's failures.

    `start_s` and `stop_s` count from the first record. What lies before `start_s` is fed all the same, since what comes
    later depends on it, but its events are not emitted. `stop` ends the replay between two records, without a summary.
    `names` gives adapters, which `config` must know by them, other names than the recording does. `step` is called
    before each scan is emitted, and before a verdict without one; time at `speed` stands still meanwhile.
    Raises what `emit` raised, and GatewayError if there is nothing from `start_s` to `stop_s`.
    """
    in_order(start_s, stop_s)
    halt = stop or threading.Event()
    pace = _Pace(speed, start_s, halt)
    gate = _Gate(emit, step, halt, pace)
    core = Core(lambda before: Pipeline(config, monitor, watcher, before), gate.emit, report)
    at_once = 1 if speed or step or watcher else RECORDS_AT_ONCE  # who watches hears each event before the next
    elapsed_s = 0.0
    timed = _timed(recording, stop_s)
    for begun, shown in groupby(timed, lambda item: item[0] >= start_s):
        gate.open = begun
        while block := list(islice(shown, at_once)):
            elapsed_s = block[-1][0]
            if begun:
                pace.wait(block[0][0])
            if halt.is_set():
                return core.failures
            records = [_renamed(record, names or {}) for _, record in block]
            if at_once == 1:
                core.process(records[0])
            else:
                core.process_all(Block.of([records]))
            if core.unheard:
                raise core.unheard
    if recording.records and not gate.open:
        raise GatewayError(
            f"{recording.path} is only {elapsed_s:.1f} s long: start before its end"
            if stop_s is None
            else f"{recording.path} has nothing from {start_s} to {stop_s}: `shadebus info` tells its times"
        )
    if halt.is_set():  # while a scan waited for its turn
        return core.failures
    core.finish()
    if core.unheard:
        raise core.unheard
    return core.failures


def _timed(recording: Recording, stop_s: float | None) -> Iterator[tuple[float, Record]]:
    """The records with their seconds since the first, up to `stop_s`."""
    first_ns: int | None = None
    for record in recording:
        first_ns = record.stamp.monotonic_ns if first_ns is None else first_ns
        elapsed_s = (record.stamp.monotonic_ns - first_ns) / 1e9
        if stop_s is not None and elapsed_s > stop_s:
            return
        yield elapsed_s, record


class _Pace:
    """Real time, or a multiple of it, from the first record that is shown."""

    def __init__(self, speed: float | None, start_s: float, halt: threading.Event) -> None:
        self._speed = speed
        self._start_s = start_s
        self._halt = halt
        self._began_ns: int | None = None

    def wait(self, elapsed_s: float) -> None:
        """Return when the record's time has come, or at the order to stop."""
        self._began_ns = time.monotonic_ns() if self._began_ns is None else self._began_ns
        if self._speed:
            due_s = (elapsed_s - self._start_s) / self._speed
            self._halt.wait(max(0.0, due_s - (time.monotonic_ns() - self._began_ns) / 1e9))

    def stand_still(self, since_ns: int) -> None:
        """What has passed since then does not count."""
        if self._began_ns is not None:
            self._began_ns += time.monotonic_ns() - since_ns


class _Gate:
    """Lets events through once it is open, scans and their verdicts one step at a time if there are steps."""

    def __init__(self, emit: Emit, step: Wait | None, halt: threading.Event, pace: _Pace) -> None:
        self.open = False
        self._emit = emit
        self._step = step
        self._halt = halt
        self._pace = pace
        self._scan: int | None = None  # the one that was let through last

    def emit(self, event: Event) -> None:
        """Emit an event, or not; after the order to stop nothing more."""
        if not self.open:
            return
        if self._step and isinstance(event, ScanEvent | IntegrityEvent) and event.scan != self._scan:
            began_ns = time.monotonic_ns()
            self._step(self._halt)
            self._pace.stand_still(began_ns)
            self._scan = event.scan
        if not (self._step and self._halt.is_set()):
            self._emit(event)


def _renamed(record: Record, names: Mapping[str, str]) -> Record:
    """The record under the new name of its adapter."""
    if isinstance(record, Raw | Status) and record.adapter in names:
        return record._replace(adapter=names[record.adapter])
    return record
