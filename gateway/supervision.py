"""One thread per adapter: open, read until it fails, say so, wait, open again, for ever.

CLOSED -> OPENING -> UP -> LOST -> OPENING ... Every change is a recorded status with its reason. A line that cannot be
opened again stays lost for the reason that it was lost for first; attempts since then are counted beside it.
"""

import contextlib
import threading
import time
from collections.abc import Callable

from gateway.adapters import Adapter, Port, Reading
from gateway.errors import GatewayError

FIRST_WAIT_S, LONGEST_WAIT_S = 0.5, 5.0
SMALL_BYTES, GATHER_S = 2048, 0.004  # a line that gives little at a time is let gather more: each chunk has its price

Report = Callable[[str, str, str], None]  # adapter, state, reason
Deliver = Callable[[str, Reading], None]  # adapter, what it read


class Supervisor:
    """Keeps one adapter open and passes its chunks on. Whatever the driver raises is a status, and then a retry."""

    def __init__(self, name: str, adapter: Adapter, deliver: Deliver, report: Report) -> None:
        self.name = name
        self._adapter = adapter
        self._deliver = deliver
        self._report = report
        self._stopping = threading.Event()
        self._first_open = threading.Event()
        self._first_error = ""
        self._lost_for, self._attempts = "", 0  # since the line was last up

    def run(self) -> None:
        """The work of the adapter's thread, until `stop`."""
        wait_s = FIRST_WAIT_S
        while not self._stopping.is_set():
            self._state("OPENING")
            try:
                port = self._adapter.open()
            except Exception as error:  # noqa: BLE001 # drivers raise anything, and none of it may end the thread
                self._first_error = self._first_error or _reason(error)
                self._first_open.set()
                self._lose(_reason(error))
                self._stopping.wait(wait_s)
                wait_s = min(2 * wait_s, LONGEST_WAIT_S)
                continue
            self._first_open.set()
            self._lost_for, self._attempts = "", 0
            self._state("UP")
            gave = self._read(port)
            wait_s = FIRST_WAIT_S if gave else min(2 * wait_s, LONGEST_WAIT_S)
            self._stopping.wait(wait_s)
        self._state("CLOSED")

    def first_error(self, timeout_s: float) -> str:
        """Why the first attempt to open failed, or nothing if it did not within the time."""
        self._first_open.wait(timeout_s)
        return self._first_error

    def stop(self) -> None:
        """Ask the thread to end; it does within a read's wait."""
        self._stopping.set()

    def _read(self, port: Port) -> bool:
        """Read until the line is lost; whether it ever gave anything."""
        gave = False
        try:
            while not self._stopping.is_set():
                reading = port.read()
                if reading.data or reading.lost:
                    self._deliver(self.name, reading)
                    gave = True
                if reading.remark:
                    self._state("UP", reading.remark)
                if 0 < len(reading.data) < SMALL_BYTES:
                    time.sleep(GATHER_S)
        except Exception as error:  # noqa: BLE001 # pyserial alone raises four unrelated kinds on unplugging
            self._lose(_reason(error))
        finally:
            with contextlib.suppress(Exception):  # the line is given up, whatever its driver says to that
                port.close()
        return gave

    def _lose(self, reason: str) -> None:
        if not self._lost_for:
            self._lost_for = reason
            self._state("LOST", reason)
            return
        self._attempts += 1
        latest = f": {reason}" if reason != self._lost_for else ""
        self._state("LOST", f"{self._lost_for} (attempt {self._attempts} to open it again failed{latest})")

    def _state(self, state: str, reason: str = "") -> None:
        self._report(self.name, state, reason)


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, GatewayError) else f"{type(error).__name__}: {error}"
