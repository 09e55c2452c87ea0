"""The thread that waits for the disk, so that neither the journal nor an adapter does.

Accepted bytes are in the kernel; this thread has the disk hold them at the stated interval, and writes the index of
files that are done with. While it waits, `write()` goes on.
"""

import contextlib
import queue
import time
from collections.abc import Callable
from dataclasses import dataclass

from gateway.recording.writer import Recorder
from gateway.threads import GuardedThread


@dataclass
class SyncFigures:
    """How many times the disk was waited for, how long in all and at most, and how long data waited at most."""

    count: int = 0
    total_ns: int = 0
    longest_ns: int = 0
    longest_exposed_ns: int = 0  # from the beginning of a synchronisation to the end of the next one

    def add(self, begin_ns: int, end_ns: int, safe_until_ns: int) -> None:
        """Count a synchronisation; what was written before `safe_until_ns` was safe already."""
        self.count += 1
        self.total_ns += end_ns - begin_ns
        self.longest_ns = max(self.longest_ns, end_ns - begin_ns)
        self.longest_exposed_ns = max(self.longest_exposed_ns, end_ns - safe_until_ns)

    def __str__(self) -> str:
        mean_ms = self.total_ns / max(self.count, 1) / 1e6
        return (
            f"{self.count} syncs of {mean_ms:.1f} ms on average and {self.longest_ns / 1e6:.1f} ms at most; "
            f"no byte waited longer than {self.longest_exposed_ns / 1e9:.2f} s for the disk"
        )


class Syncer:
    """Synchronises the file that is written, and closes those that are done with."""

    def __init__(
        self,
        interval_s: float,
        failed: Callable[[Recorder, OSError], None],
        died: Callable[[str, BaseException], None],
    ) -> None:
        self.figures = SyncFigures()
        self._interval_s = interval_s
        self._failed = failed
        self._current: Recorder | None = None
        self._safe_until_ns: dict[Recorder, int] = {}
        self._retired: queue.Queue[tuple[Recorder, bool] | None] = queue.Queue()
        self._thread = GuardedThread("recording", self._run, died)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def watch(self, recorder: Recorder) -> None:
        """Synchronise this file from now on."""
        self._safe_until_ns[recorder] = time.monotonic_ns()
        self._current = recorder

    def retire(self, recorder: Recorder, *, whole: bool) -> None:
        """Close a file that nobody writes to any more, with its index if it is whole."""
        if self._current is recorder:
            self._current = None
        self._retired.put((recorder, whole))

    def stop(self) -> None:
        """Return once every file that was retired is closed."""
        self._retired.put(None)
        self._thread.join()

    def _run(self) -> None:
        due_s = time.monotonic() + self._interval_s
        while True:
            try:
                job = self._retired.get(timeout=max(due_s - time.monotonic(), 0))
            except queue.Empty:
                if current := self._current:
                    self._measured(current, current.sync)
                due_s = time.monotonic() + self._interval_s
                continue
            if job is None:
                return
            recorder, whole = job
            self.close(recorder, whole=whole)

    def close(self, recorder: Recorder, *, whole: bool) -> None:
        """Close a file in the calling thread; one that never held a record goes."""
        if not (whole and self._measured(recorder, recorder.close)):
            recorder.abandon()
            if not recorder.records:
                with contextlib.suppress(OSError):
                    recorder.path.unlink(missing_ok=True)
        self._safe_until_ns.pop(recorder, None)

    def _measured(self, recorder: Recorder, work: Callable[[], None]) -> bool:
        begin_ns = time.monotonic_ns()
        try:
            work()
        except OSError as error:
            self._failed(recorder, error)
            return False
        self.figures.add(begin_ns, time.monotonic_ns(), self._safe_until_ns.get(recorder, begin_ns))
        self._safe_until_ns[recorder] = begin_ns
        return True
