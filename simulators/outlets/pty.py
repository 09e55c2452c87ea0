"""Pseudo-terminals: what a gateway opens as a serial port, or as a CAN adapter that speaks in lines of text."""

import contextlib
import fcntl
import math
import os
import select
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

from simulators.outlets.base import DRAIN_S, POLL_S, STALL_S, Closed, Closing

READ_BYTES = 4096


class PtyOutlet(Closing):
    """A raw pseudo-terminal that looks like a serial port: open `path` to read.

    The kernel holds about 4 kB; when that is full, `write` waits. The subordinate end stays open here, so that readers
    may come and go. `on_stall` is called once for each write that finds nobody reading. What the host writes is taken
    off the line and ignored.

    `link` is a name of its own for the terminal, a symbolic link as in /dev/serial/by-id: it goes when the terminal is
    unplugged and points to the new one after `replug`.
    """

    scheme: ClassVar[str] = "serial:"

    def __init__(self, link: Path | None = None) -> None:
        self.on_stall: Callable[[], None] = lambda: None
        self._link = link
        self._closing = threading.Event()
        self._lock = threading.Lock()
        self._plugged = False
        self._open()
        self.replug()

    @property
    def place(self) -> str:
        """The gateway's name for this line."""
        return f"{self.scheme}{self._link or self.path}"

    def write(self, data: bytes) -> None:
        """Write every byte, however long the reader takes, or none while unplugged; raises Closed after `close`."""
        rest = memoryview(data)
        stalled_s = time.monotonic() + STALL_S
        while rest:
            with self._lock:
                if self._closing.is_set():
                    raise Closed(f"pseudo-terminal {self.path} is closed")
                if not self._plugged:
                    return
                rest = rest[self._write_some(rest) :]
            if rest and time.monotonic() > stalled_s:
                stalled_s = math.inf
                self.on_stall()

    def unplug(self) -> None:
        """Hang up: readers get an error, what they have not read is gone, and what is written now vanishes."""
        with self._lock:
            if not self._plugged or self._closing.is_set():
                return
            self._plugged = False
            if self._link:
                self._link.unlink(missing_ok=True)
            before = self._master, self._slave
            self._open()  # while the old one is still there, as the kernel gives a free name again at once
            for end in before:
                os.close(end)

    def replug(self) -> None:
        """Come back, after `unplug` under another name."""
        with self._lock:
            if self._closing.is_set():
                return
            self._plugged = True
            if self._link:
                self._link.unlink(missing_ok=True)
                self._link.symlink_to(self.path)

    def close(self) -> None:
        """Wait up to a second for the reader to empty the terminal, because closing it discards what is inside."""
        if self._closing.is_set():
            return
        self._closing.set()
        with self._lock:
            self.drain()
            if self._link:
                self._link.unlink(missing_ok=True)
            os.close(self._slave)
            os.close(self._master)

    def drain(self) -> None:
        """Wait up to a second for the reader to empty the terminal.

        Two empty looks in a row, as bytes move into the reader's queue a moment after they are written.
        """
        deadline, empty = time.monotonic() + DRAIN_S, 0
        while empty < 2 and time.monotonic() < deadline:
            (waiting,) = struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))
            empty = 0 if waiting else empty + 1
            time.sleep(0.01)

    def _open(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    def _write_some(self, data: memoryview) -> int:
        """How many bytes the terminal took; also drops what the host has written, lest its queue fills up."""
        said, ready, _ = select.select([self._master], [self._master], [], POLL_S)
        if said:
            os.read(self._master, READ_BYTES)
        if ready:
            with contextlib.suppress(BlockingIOError):
                return os.write(self._master, data)
        return 0


class SlcanOutlet(PtyOutlet):
    """A CAN adapter on a serial line: takes the text lines of `carriers.slcan`.

    It answers nothing; the commands of the host (C, S6, O, L) are dropped like all that it writes.
    """

    scheme = "can:slcan:"
