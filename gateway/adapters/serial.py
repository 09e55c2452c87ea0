"""Serial lines through pyserial: devices, `socket://` and `rfc2217://`."""

import contextlib
import errno
import select
import socket
from queue import Empty
from typing import Any
from urllib.parse import urlsplit

import serial

from gateway.adapters import NOTHING, Reading, stream
from gateway.config import AdapterConfig
from gateway.errors import GatewayError

LONGEST_WAIT_S = 0.2  # so that a silent line still notices the order to stop
LARGEST_READ = 65_536
REMOTE = ("socket://", "rfc2217://")
KEEP_ALIVE = {socket.TCP_KEEPIDLE: 5, socket.TCP_KEEPINTVL: 2, socket.TCP_KEEPCNT: 3}  # told to be dead after 11 s

MENDS = {
    errno.ENOENT: "no such device: plug it in, or see `ls /dev/serial/by-id` for its name",
    errno.EACCES: "no permission: add yourself to the dialout group, or see `shadebus doctor`",
    errno.EBUSY: "in use: another program holds the line",
    errno.EAGAIN: "in use: another program holds the line",
    errno.ENOTTY: "not a serial line",
    errno.ECONNREFUSED: "connection refused: nothing listens at that address",
}


class SerialPort:
    """An open line.

    pyserial's `read` gathers until it has what was asked for or its time is over, and forgets what it has gathered
    when the line breaks meanwhile. So we wait ourselves and let it read once, with no time to gather. A telnet line
    (rfc2217) has nothing to wait on, but a queue of its own that keeps its bytes.
    """

    def __init__(self, line: serial.Serial, *, telnet: bool) -> None:
        self._line = line
        self._telnet = telnet

    def read(self) -> Reading:
        """Whatever has come, up to 64 KiB."""
        if self._telnet:
            return stream(_read_telnet(self._line))
        ready, _, _ = select.select([self._line], [], [], LONGEST_WAIT_S)
        try:
            return stream(self._line.read(LARGEST_READ)) if ready else NOTHING
        except serial.SerialException as error:
            if "returned no data" not in str(error):  # how pyserial words a line that has gone
                raise
            raise serial.SerialException("unplugged, or its other end is closed") from error

    def close(self) -> None:
        """Close the line; an unplugged one may object in many ways, none of which matters any more."""
        with contextlib.suppress(Exception):
            self._line.close()


class SerialAdapter:
    """A serial line by device path or pyserial URL."""

    def __init__(self, address: str, baud: int) -> None:
        self.address = address
        self.baud = baud

    def open(self) -> SerialPort:
        """Open the line for this process alone. Raises GatewayError with the mend."""
        telnet = self.address.startswith("rfc2217://")
        exclusive = None if self.address.startswith(REMOTE) else True
        timeout_s = LONGEST_WAIT_S if telnet else 0
        try:
            line = serial.serial_for_url(
                self.address, do_not_open=True, baudrate=self.baud, timeout=timeout_s, exclusive=exclusive
            )
            # pyserial throws away what has come while it was opening, and with it a bridge's hello.
            line.reset_input_buffer = line._reset_input_buffer = _keep  # type: ignore[method-assign, attr-defined]
            line.open()
            _hurry(line)
            _keep_alive(line)
        except (OSError, ValueError) as error:
            raise GatewayError(f"serial line {self.address}: {MENDS.get(error_number(error), error)}") from error
        return SerialPort(line, telnet=telnet)


def _hurry(line: serial.Serial) -> None:
    """Have a USB adapter hand over bytes at once instead of gathering them for 16 ms; most lines know no such thing."""
    with contextlib.suppress(OSError, ValueError, AttributeError, NotImplementedError):
        line.set_low_latency_mode(True)


def _keep_alive(line: Any) -> None:
    """Have the kernel ask whether a TCP peer is still there: we only listen, and would wait for a dead one for ever."""
    peer = getattr(line, "_socket", None)
    if peer is not None:
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in KEEP_ALIVE.items():
            peer.setsockopt(socket.IPPROTO_TCP, option, value)


def error_number(error: BaseException | None) -> int:
    """The errno, which pyserial may have left in what it caught; 0 if there is none."""
    causes = (error.args, error.__context__.args if error.__context__ else ()) if error else ()
    return next((args[0] for args in causes if args and isinstance(args[0], int)), 0)


def _read_telnet(line: Any) -> bytes:
    """What pyserial's thread has queued; its own `read` forgets the queue as soon as the line breaks."""
    alive = line._thread.is_alive()  # asked before the queue, which this thread fills
    queue = line._read_buffer
    try:
        first = queue.get(timeout=LONGEST_WAIT_S if alive else 0)
    except Empty:
        if alive:
            return b""
        raise serial.SerialException("the other end has hung up") from None
    return b"".join(part or b"" for part in (first, *(queue.get() for _ in range(queue.qsize()))))


def _keep() -> None:
    """Leave the input buffer as it is."""


def make(address: str, config: AdapterConfig) -> SerialAdapter:
    """The adapter of a `serial:` source. Raises GatewayError for the address of a server that cannot be one."""
    if address.startswith(REMOTE):
        scheme, _, _ = address.partition("://")
        try:
            parts = urlsplit(address)
            whole = bool(parts.hostname and parts.port)
        except ValueError:  # a port that is no number, or above 65535
            whole = False
        if not whole:
            raise GatewayError(f"serial line {address}: write {scheme}://HOST:PORT with a port from 1 to 65535")
    return SerialAdapter(address, config.baud)
