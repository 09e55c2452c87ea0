"""What UDP and SocketCAN share: large kernel buffers, and the kernel's count of what did not fit into them."""

import contextlib
import select
import socket
import struct
from collections.abc import Iterable

LONGEST_WAIT_S = 0.2  # so that a silent line still notices the order to stop
RECEIVE_BYTES = 8 << 20  # a second and more of everything, counted with the kernel's overhead
SO_RCVBUFFORCE = 33  # Linux: beyond net.core.rmem_max, for root
SO_RXQ_OVFL = 40  # Linux: each message tells how many were dropped before it
WRAP = 1 << 32


def prepare(line: socket.socket, receive_bytes: int) -> None:
    """Ask for room in the kernel and for the count of what finds none; reads do not wait from now on."""
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    with contextlib.suppress(PermissionError):
        line.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, receive_bytes)
    line.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
    line.setblocking(False)


def wait(line: socket.socket) -> bool:
    """Whether a message comes within a short time."""
    ready, _, _ = select.select([line], [], [], LONGEST_WAIT_S)
    return bool(ready)


class Overflows:
    """The kernel's counter of dropped messages, which comes beside a message once any was dropped."""

    SPACE = socket.CMSG_SPACE(4)

    def __init__(self) -> None:
        self._dropped = 0

    def since(self, beside: Iterable[tuple[int, int, bytes]]) -> int:
        """How many messages were dropped between the one before and the one with this beside it."""
        for level, kind, data in beside:
            if (level, kind) == (socket.SOL_SOCKET, SO_RXQ_OVFL):
                (dropped,) = struct.unpack("I", data[:4])
                new = int(dropped - self._dropped) % WRAP
                self._dropped = dropped
                return new
        return 0
