"""Where simulated traffic goes: a pseudo-terminal, a TCP client or a file. None loses a byte to a slow reader."""

import contextlib
import fcntl
import math
import os
import select
import socket
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable
from io import BufferedWriter
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

POLL_S = 0.1
LAST_PORT = 65_535
DRAIN_S = 1.0
STALL_S = 2.0  # no reader in its senses takes so long for 4 kB


class Closed(Exception):
    """The outlet was closed, or its reader has left."""


class Outlet(Protocol):
    """What `play` writes to."""

    def write(self, data: bytes) -> None:
        """Hand over all bytes, waiting for a slow reader; raises Closed when there is none any more."""

    def close(self) -> None:
        """Let the reader finish, then release the resources; a second call does nothing."""


class _Closing:
    """Closes on leaving a `with` block."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        raise NotImplementedError


class PtyOutlet(_Closing):
    """A raw pseudo-terminal that looks like a serial port: open `path` to read.

    The kernel holds about 4 kB; when that is full, `write` waits. The subordinate end stays open here,
    so that readers may come and go. `on_stall` is called once for each write that finds nobody reading.
    """

    def __init__(self) -> None:
        self.on_stall: Callable[[], None] = lambda: None
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self.place = f"serial:{self.path}"
        self._closing = threading.Event()
        self._lock = threading.Lock()

    def write(self, data: bytes) -> None:
        """Write every byte, however long the reader takes; raises Closed once `close` was called."""
        rest = memoryview(data)
        stalled_s = time.monotonic() + STALL_S
        while rest:
            with self._lock:
                if self._closing.is_set():
                    raise Closed(f"pseudo-terminal {self.path} is closed")
                _, ready, _ = select.select([], [self._master], [], POLL_S)
                if ready:
                    with contextlib.suppress(BlockingIOError):
                        rest = rest[os.write(self._master, rest) :]
            if rest and time.monotonic() > stalled_s:
                stalled_s = math.inf
                self.on_stall()

    def close(self) -> None:
        """Wait up to a second for the reader to empty the terminal, because closing it discards what is inside."""
        if self._closing.is_set():
            return
        self._closing.set()
        with self._lock:
            self.drain()
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


class TcpOutlet(_Closing):
    """Listens on the loopback interface and serves one client; `address` tells where."""

    def __init__(self, port: int = 0) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.settimeout(POLL_S)
        self.address: tuple[str, int] = self._listener.getsockname()
        self.place = "serial:socket://{}:{}".format(*self.address)
        self._client: socket.socket | None = None
        self._closing = threading.Event()

    def write(self, data: bytes) -> None:
        """Send every byte, waiting first for a client; raises Closed when the client has left or `close` was called."""
        client = self._client or self._accept()
        try:
            client.sendall(data)
        except OSError as error:
            raise Closed(f"the client of {self.address} has left: {error}") from error

    def close(self) -> None:
        """End the stream after everything sent, and stop listening."""
        self._closing.set()
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.shutdown(socket.SHUT_WR)
            self._client.close()
        self._listener.close()

    def _accept(self) -> socket.socket:
        while not self._closing.is_set():
            try:
                self._client, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                break  # closed while waiting
            self._client.settimeout(None)
            return self._client
        raise Closed(f"{self.address} is closed")


class FileOutlet(_Closing):
    """The stream as a file, made anew when the first packet is there to be written."""

    def __init__(self, path: Path) -> None:
        self.place = ""
        self._path = path
        self._file: BufferedWriter | None = None

    def write(self, data: bytes) -> None:
        """Append to the file; raises OSError when it cannot."""
        self._file = self._file or self._path.open("wb")
        self._file.write(data)

    def close(self) -> None:
        """Finish the file. Raises OSError when it cannot."""
        if self._file:
            self._file.close()


def named(text: str) -> PtyOutlet | TcpOutlet | FileOutlet:
    """The outlet of `pty`, `tcp:PORT` or `file:PATH`; its `place` is what a gateway calls it, if it can listen to it.

    Raises ValueError for any other text, and OSError where the system does not grant it.
    """
    kind, _, address = text.partition(":")
    if kind == "pty":
        return PtyOutlet()
    if kind == "tcp":
        if address and not (address.isdecimal() and int(address) <= LAST_PORT):
            raise ValueError(f"{address!r} is no port: use 1 to {LAST_PORT}, or 0 for a free one")
        return TcpOutlet(int(address or "0"))
    if kind == "file" and address:
        return FileOutlet(Path(address))
    raise ValueError("use pty, tcp:PORT or file:PATH")
