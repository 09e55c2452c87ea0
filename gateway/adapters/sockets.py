"""What UDP and SocketCAN share: large kernel buffers, and the kernel's count of what did not fit into them."""

import contextlib
import select
import socket
import struct

LONGEST_WAIT_S = 0.2  # so that a silent line still notices the order to stop
RECEIVE_BYTES = 8 << 20  # a second and more of everything, counted with the kernel's overhead
SO_RCVBUFFORCE = 33  # Linux: beyond net.core.rmem_max, for root
SO_MEMINFO = 55  # Linux: what a socket holds in memory, and how many messages it had to drop
MEMINFO = struct.Struct("9I")
WRAP = 1 << 32


def prepare(line: socket.socket, receive_bytes: int) -> None:
    """Ask for room in the kernel; reads do not wait from now on."""
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    with contextlib.suppress(PermissionError):
        line.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, receive_bytes)
    line.setblocking(False)


def wait(line: socket.socket) -> bool:
    """Whether a message comes within a short time."""
    ready, _, _ = select.select([line], [], [], LONGEST_WAIT_S)
    return bool(ready)


class Overflows:
    """The kernel's count of messages that a socket had to drop.

    SO_RXQ_OVFL would tell it beside the next message only: of a burst that nothing follows, never.
    """

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self._dropped = 0

    def new(self) -> int:
        """How many messages were dropped since the last call."""
        *_, dropped = MEMINFO.unpack(self._line.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, MEMINFO.size))
        new = int(dropped - self._dropped) % WRAP
        self._dropped = dropped
        return new
