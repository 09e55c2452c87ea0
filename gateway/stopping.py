"""SIGINT and SIGTERM as an event to be asked for between two records.

An exception that a signal raises inside a compiled kernel is swallowed or ends in a crash, so none is raised here.
"""

import _thread
import os
import signal
import threading
import time
from collections.abc import Iterable, Iterator
from types import FrameType
from typing import TypeVar

PATIENCE_S = 2.0  # for a compilation, or a reader of our output that stands still

Item = TypeVar("Item")


class Stop(threading.Event):
    """Set by SIGINT or SIGTERM from its making on; `exit_code` is then 128 and the number of the signal, as in a shell.

    A process that is still there `patience_s` after the signal is left at once with that code.
    """

    def __init__(self, patience_s: float | None = PATIENCE_S) -> None:
        super().__init__()
        self.exit_code = 0
        self._patience_s = patience_s
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take)

    def until(self, items: Iterable[Item]) -> Iterator[Item]:
        """The items that come before the signal, which ends the process with `exit_code`."""
        for item in items:
            self.obey()
            yield item
        self.obey()

    def obey(self) -> None:
        """Raise SystemExit with `exit_code` if the signal has come."""
        if self.is_set():
            raise SystemExit(self.exit_code)

    def _take(self, number: int, _: FrameType | None) -> None:
        self.exit_code = 128 + number
        _thread.start_new_thread(self._tell, ())  # the interrupted thread may hold this event's lock

    def _tell(self) -> None:
        self.set()
        if self._patience_s is not None:
            time.sleep(self._patience_s)
            os._exit(self.exit_code)
