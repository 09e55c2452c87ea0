"""Threads that cannot die silently."""

import threading
from collections.abc import Callable


class GuardedThread(threading.Thread):
    """Does its work and, whatever ends it early, tells `on_death` its name and the error."""

    def __init__(self, name: str, work: Callable[[], None], on_death: Callable[[str, BaseException], None]) -> None:
        super().__init__(name=name, daemon=True)
        self._work = work
        self._on_death = on_death

    def run(self) -> None:
        """The thread's work."""
        try:
            self._work()
        except BaseException as error:  # noqa: BLE001 # the one place where nothing may pass unnoticed
            self._on_death(self.name, error)
