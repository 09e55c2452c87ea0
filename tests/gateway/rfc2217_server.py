"""A serial line served over the network by pyserial's own RFC 2217 server, on the loopback interface."""

import contextlib
import socket
import threading

import serial
from serial import rfc2217


class Server:
    """Serves one client inside a `with` block; `send` puts bytes on the line that it reads."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._connection: socket.socket | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> "Server":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.hang_up()
        self._listener.close()
        self._thread.join(10)

    def write(self, data: bytes) -> None:
        """Feed `rfc2217.PortManager`, which answers the client through this."""
        if self._connection:
            self._connection.sendall(data)

    def send(self, data: bytes) -> None:
        """Send bytes once a client has come, escaped as the protocol asks."""
        assert self._ready.wait(10)
        self.write(b"".join(self._manager.escape(data)))

    def hang_up(self) -> None:
        """Leave the client."""
        if self._connection:
            with contextlib.suppress(OSError):
                self._connection.shutdown(socket.SHUT_RDWR)

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            self._connection, _ = self._listener.accept()
        if self._connection is None:
            return
        with self._connection, serial.serial_for_url("loop://") as line, contextlib.suppress(OSError):
            self._manager = rfc2217.PortManager(line, self)  # type: ignore[arg-type] # the stubs ask for its client
            self._ready.set()
            while data := self._connection.recv(1024):
                for _ in self._manager.filter(data):
                    pass
