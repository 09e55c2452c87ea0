"""The gateway as a whole: adapters, journal and core, started and stopped in the order that loses nothing."""

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

from gateway.adapters import make_adapter
from gateway.config import RackConfig
from gateway.core import Core, CoreQueue, Emit
from gateway.errors import GatewayError
from gateway.journal import Journal
from gateway.metadata import describe
from gateway.pipeline import Pipeline, Watcher
from gateway.recording import Recording
from gateway.recording.keeper import NAME, Keeper
from gateway.records import Raw
from gateway.supervision import Supervisor
from gateway.threads import GuardedThread
from gateway.warmup import warm_up_gateway, warm_up_words
from monitor.integrity import Monitor

FIRST_OPEN_S = 3.0
POLL_S = 0.1
MOST_FAILURES = 10
DRIVER_S = 5.0  # for all drivers to come back from a read, or from opening a device that takes no bytes
LAST_WORDS_S = 30.0  # for a backlog of events; then the process ends whether they were read or not


class Service:
    """Runs until stopped. `failures` says what broke: a run with any ends with a non-zero exit."""

    def __init__(self, config: RackConfig, monitor: Monitor | None, emit: Emit, watcher: Watcher | None = None) -> None:
        self.failures: list[str] = []
        self.broken = threading.Event()  # set when a thread that the gateway cannot do without has died
        self._config = config
        adapters = [(a.name, make_adapter(a)) for a in config.adapters]
        self._keeper = self._keeper_of(config, monitor)
        limit_bytes = (config.recording.queue_mib if config.recording else 64) << 20
        self._to_core = CoreQueue(lambda reason: self._journal.report("core", "BEHIND", reason))
        self._journal = Journal(self._keeper, self._to_core.deliver, limit_bytes)
        self._core = core = Core(lambda before: Pipeline(config, monitor, watcher, before), emit, self._core_failed)
        self._warm = threading.Event()  # set when the core has its kernels, for which a first start compiles

        def core_work() -> None:
            try:
                if monitor:  # the journal records meanwhile
                    warm_up_gateway(monitor)
                else:
                    warm_up_words()
            finally:
                self._warm.set()
            self._to_core.run(core)

        self._supervisors = [
            Supervisor(name, adapter, self._journal.chunk, self._journal.report) for name, adapter in adapters
        ]
        self._core_thread = self._thread("core", core_work)
        self._journal_thread = self._thread("journal", self._journal.run)
        self._adapter_threads = [self._thread(f"adapter {s.name}", s.run) for s in self._supervisors]

    def start(self) -> None:
        """Start every thread. Raises GatewayError if a device cannot be opened and the configuration does not wait."""
        self._journal_thread.start()
        for thread in self._adapter_threads:
            thread.start()
        if not self._config.wait_for_devices:
            errors = [error for s in self._supervisors if (error := s.first_error(FIRST_OPEN_S))]
            if errors:
                self.stop()
                self._forget_an_empty_recording()
                raise GatewayError("; ".join(errors))
        self._core_thread.start()

    @property
    def recording_path(self) -> Path | None:
        """The first file of the recording."""
        return self._keeper.path if self._keeper else None

    @property
    def deserted(self) -> Exception | None:
        """Why the service has nobody left to work for: its events are not heard, and it does not record."""
        return None if self.recording_path else self._core.unheard

    @property
    def stuck(self) -> bool:
        """Whether the core did not come to its end in time, so that only leaving the process ends it."""
        return self._core_thread.is_alive()

    def run_until(self, stop: threading.Event, seconds: float | None = None) -> None:
        """Run until `stop` is set, the time is over, or a thread that the gateway needs has died."""
        self.start()
        deadline = math.inf if seconds is None else time.monotonic() + seconds
        while not stop.is_set() and not self.broken.is_set():
            if not time.monotonic() < deadline:  # written so that no number of seconds runs for ever
                break
            stop.wait(POLL_S)
        self.stop()

    def stop(self) -> None:
        """Stop reading, write down what was read, answer what was written, then return."""
        for supervisor in self._supervisors:
            supervisor.stop()
        give_up_s = time.monotonic() + DRIVER_S
        for thread in self._adapter_threads:
            thread.join(max(give_up_s - time.monotonic(), 0))
            if thread.is_alive():
                self.failures.append(f"{thread.name}: its driver does not come back; it is left behind")
        self._journal.queue.close()
        self._journal_thread.join()
        self._end_core()
        if self._to_core.skipped:
            self.failures.append(f"core: {self._to_core.skipped} records skipped at the end; replay the recording")
        if self._keeper and self._keeper.failure:
            self.failures.append(f"recording stopped: {self._keeper.failure}")
        if self._keeper and self._keeper.lost:
            self.failures.append(f"recording: {self._keeper.lost} records were not recorded")

    def _end_core(self) -> None:
        self._to_core.queue.close()
        if self._core_thread.ident is None:  # never started: a device could not be opened
            return
        self._warm.wait()  # the time that a first start compiles is not that of its last words
        self._core_thread.join(LAST_WORDS_S)
        if self._core_thread.is_alive():
            self.failures.append(
                f"core: still not done {LAST_WORDS_S:.0f} s after the end; whoever reads our output stands still"
            )

    def _keeper_of(self, config: RackConfig, monitor: Monitor | None) -> Keeper | None:
        if config.recording is None:
            return None

        def report(state: str, reason: str) -> None:
            self._journal.report(NAME, state, reason)

        return Keeper(config.recording, describe(config, monitor), report, self._died)

    def _forget_an_empty_recording(self) -> None:
        path = self.recording_path
        if path and not any(isinstance(record, Raw) for record in Recording(path)):
            path.unlink()

    def _thread(self, name: str, work: Callable[[], None]) -> GuardedThread:
        return GuardedThread(name, work, self._died)

    def _core_failed(self, reason: str) -> None:
        if len(self.failures) < MOST_FAILURES:  # the recording has them all
            self.failures.append(f"core: {reason}")
        self._journal.report("core", "FAILED", reason)
        if self.deserted:
            self.broken.set()

    def _died(self, name: str, error: BaseException) -> None:
        reason = f"{type(error).__name__}: {error}"
        self.failures.append(f"thread {name} died: {reason}")
        self._journal.report(name, "DIED", reason)
        self.broken.set()
