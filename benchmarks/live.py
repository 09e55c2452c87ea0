"""From a radial that came in to the verdicts that it updates, time of computing. `make live`. Exits 1 beyond the limit.

A rack as live as a recording can be: every chunk of 10 ms of a radar of 80 words/s, an IRU, a GNSS receiver and a radio
altimeter, with every label at its shortest interval, is handed over by itself, and its events are written as JSON. The
limit holds for 99 of 100 chunks; those that close a scan, fewer than one in a hundred, are printed by themselves. What
counts is the time that the thread had a processor for, so that other programs do not; the clock's is printed too.
"""

import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.hours import record
from gateway.core import Core
from gateway.events import Event, IntegrityEvent
from gateway.metadata import recorded_config, recorded_monitor
from gateway.pipeline import Pipeline
from gateway.recording import Recording
from gateway.records import Raw, Record
from gateway.warmup import warm_up_gateway

LIMIT_MS = 2.0
PERCENTILES = (50, 99, 99.9, 100)


def main() -> None:
    """Record, hand over, print, and judge."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "flight.mcap"
        record(path, brim=False)
        recording = Recording(path)
        config = recorded_config(recording.metadata)
        monitor = recorded_monitor(recording.metadata, config, ())
        assert monitor is not None
        records = list(recording)
    warm_up_gateway(monitor)
    judged: list[int] = []

    def take(event: Event) -> None:
        event.to_json()
        if isinstance(event, IntegrityEvent):
            judged.append(event.scan)

    failures: list[str] = []
    core = Core(lambda before: Pipeline(config, monitor, before=before), take, failures.append)
    computed_ms, waited_ms, closes = _handed_over(core, records, judged)
    if failures or not closes.any():
        raise SystemExit(f"no scan was judged: {failures}")
    _print("chunks", computed_ms, waited_ms)
    _print("of these, chunks that close a scan", computed_ms[closes], waited_ms[closes])
    p99 = float(np.percentile(computed_ms, 99))
    print(f"99 % of the chunks within {p99:.2f} ms of computing, {p99 / LIMIT_MS:.2f} of the limit of {LIMIT_MS:g} ms")
    if p99 > LIMIT_MS:
        raise SystemExit(1)


def _handed_over(
    core: Core, records: Iterable[Record], judged: list[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Milliseconds of computing and of the clock for each chunk (n,), and which of them brought a verdict."""
    computed, waited, closes = [], [], []
    for one in records:
        before, cpu_ns, clock_ns = len(judged), time.thread_time_ns(), time.perf_counter_ns()
        core.process(one)
        if isinstance(one, Raw):
            computed.append((time.thread_time_ns() - cpu_ns) / 1e6)
            waited.append((time.perf_counter_ns() - clock_ns) / 1e6)
            closes.append(len(judged) > before)
    return np.array(computed), np.array(waited), np.array(closes)


def _print(what: str, computed_ms: NDArray[np.float64], waited_ms: NDArray[np.float64]) -> None:
    figures = (
        f"{'all' if p == 100 else f'{p:g} %'} within {np.percentile(computed_ms, p):.2f} ms"
        f" ({np.percentile(waited_ms, p):.2f} by the clock)"
        for p in PERCENTILES
    )
    print(f"{len(computed_ms)} {what}: {', '.join(figures)}")


if __name__ == "__main__":
    main()
