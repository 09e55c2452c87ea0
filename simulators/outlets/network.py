"""A TCP client served, and UDP datagrams to an address."""

import contextlib
import socket
import threading

from simulators.outlets.base import POLL_S, Closed, Closing


class TcpOutlet(Closing):
    """Listens on the loopback interface and serves one client; `address` tells where."""

    def __init__(self, port: int = 0) -> None:
        self._listener = _listening(port)
        self.address: tuple[str, int] = self._listener.getsockname()
        self.place = "serial:socket://{}:{}".format(*self.address)
        self._client: socket.socket | None = None
        self._plugged = True
        self._closing = threading.Event()

    def write(self, data: bytes) -> None:
        """Send every byte, waiting first for a client; raises Closed when the client has left or `close` was called."""
        if not self._plugged:
            return
        client = self._client or self._accept()
        try:
            client.sendall(data)
        except OSError as error:
            raise Closed(f"the client of {self.address} has left: {error}") from error

    def drain(self) -> None:
        """Nothing to wait for: what was sent arrives before the end of the connection."""

    def unplug(self) -> None:
        """The client is cut off, nobody can connect, and what is written now vanishes."""
        self._plugged = False
        self._hang_up()
        self._listener.close()

    def replug(self) -> None:
        """Listen again at the same address."""
        self._listener = _listening(self.address[1])
        self._plugged = True

    def close(self) -> None:
        """End the stream after everything sent, and stop listening."""
        self._closing.set()
        self._hang_up()
        self._listener.close()

    def _hang_up(self) -> None:
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.shutdown(socket.SHUT_WR)
            self._client.close()
            self._client = None

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


def _listening(port: int) -> socket.socket:
    listener = socket.create_server(("127.0.0.1", port))
    listener.settimeout(POLL_S)
    return listener


class UdpOutlet(Closing):
    """Datagrams to an address, heard or not, from a port of its own. What the listener's queue cannot hold is lost."""

    def __init__(self, host: str, port: int) -> None:
        """Raises OSError for a host that cannot be found."""
        family, kind, protocol, _, address = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_DGRAM)[0]
        self._to = address
        self._socket = socket.socket(family, kind, protocol)
        self.place = f"udp:{host}:{port}"
        self._closed = False

    def write(self, data: bytes) -> None:
        """Send one datagram; raises Closed after `close`, and OSError where the network is unreachable."""
        try:
            self._socket.sendto(data, self._to)
        except OSError as error:
            if self._closed:
                raise Closed(f"{self.place} is closed") from error
            raise

    def close(self) -> None:
        """Give the port back."""
        self._closed = True
        self._socket.close()
