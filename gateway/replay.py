"""Replay: the records of a file through the same core as live."""

import threading
import time
from collections.abc import Callable

from gateway.config import RackConfig
from gateway.core import Core, Emit
from gateway.errors import GatewayError
from gateway.events import Event
from gateway.pipeline import Pipeline, Watcher
from gateway.recording import Recording
from monitor.integrity import Monitor


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
) -> int:
    """Emit the events of a recording, as fast as possible or at `speed` times real time; return the core's failures.

    `start_s` and `stop_s` count from the first record. What lies before `start_s` is fed all the same, since what comes
    later depends on it, but its events are not emitted. `stop` ends the replay between two records, without a summary.
    Raises what `emit` raised, and GatewayError if `start_s` lies past the end.
    """
    begun = False

    def emit_once_begun(event: Event) -> None:
        if begun:
            emit(event)

    core = Core(lambda before: Pipeline(config, monitor, watcher, before), emit_once_begun, report)
    halt = stop or threading.Event()
    began_ns = time.monotonic_ns()
    first_ns: int | None = None
    elapsed_s = 0.0
    for record in recording:
        first_ns = record.stamp.monotonic_ns if first_ns is None else first_ns
        elapsed_s = (record.stamp.monotonic_ns - first_ns) / 1e9
        if stop_s is not None and elapsed_s > stop_s:
            break
        if not begun and elapsed_s >= start_s:
            begun, began_ns = True, time.monotonic_ns()
        if begun and speed:
            halt.wait(max(0.0, (elapsed_s - start_s) / speed - (time.monotonic_ns() - began_ns) / 1e9))
        if halt.is_set():
            return core.failures
        core.process(record)
        if core.unheard:
            raise core.unheard
    else:
        if first_ns is not None and not begun:
            raise GatewayError(f"{recording.path} is only {elapsed_s:.1f} s long: start before its end")
    core.finish()
    if core.unheard:
        raise core.unheard
    return core.failures
