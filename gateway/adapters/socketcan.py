"""The kernel's CAN interfaces, by a socket of our own: python-can does not read how many frames the kernel dropped."""

import contextlib
import errno
import os
import socket
import struct
import time

from decoders import formats as f
from gateway.adapters import NOTHING, Reading
from gateway.adapters.sockets import RECEIVE_BYTES, Overflows, prepare, wait
from gateway.errors import GatewayError

HEAD = struct.Struct(f.CAN_RECORD)
FRAME = struct.Struct("=IBBxx")  # identifier with flags, length, FD flags: the head of can_frame and canfd_frame
LARGEST_FRAME = 72
FD_FRAME = 0x04  # flag of a frame that has FD's form
MOST_AT_ONCE = 512
CAN_RAW_ERR_FILTER = 2  # linux/can/raw.h; Python has no name for it
CONTROLLER, BUS_OFF = 0x04, 0x40  # kinds of error frames, in their identifier; linux/can/error.h
RX_OVERFLOW = 0x01  # of a controller, in the second byte

MENDS = {
    errno.ENODEV: "no such interface: see `ip link show type can`",
    errno.ENETDOWN: "the interface is down: sudo ip link set {} up type can bitrate 1000000",
}
OFF = "the controller is off the bus after too many errors: `ip link set ... type can restart-ms 100` lets it return"


class SocketCanPort:
    """An open raw socket, for classic and FD frames alike."""

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self._overflows = Overflows(line)
        self._end: OSError | None = None

    def read(self) -> Reading:
        """The frames that have come, up to 512. Raises OSError once the interface is down or gone and none is left."""
        if not self._end and not wait(self._line):
            return NOTHING
        chunk, count, overflows, remark = bytearray(), 0, 0, ""
        with contextlib.suppress(BlockingIOError):
            while count < MOST_AT_ONCE:
                frame = self._receive()
                identifier, length, flags = FRAME.unpack_from(frame)
                flags |= FD_FRAME * (len(frame) == LARGEST_FRAME)
                chunk += HEAD.pack(time.monotonic_ns(), identifier, flags, length)
                chunk += frame[FRAME.size : FRAME.size + length]
                count += 1
                if identifier & f.CAN_ERROR:
                    overflows += bool(identifier & CONTROLLER and frame[FRAME.size + 1] & RX_OVERFLOW)
                    remark = OFF if identifier & BUS_OFF else remark
        lost = overflows + self._overflows.new()  # a controller does not tell how many frames an overflow cost it
        if self._end and not count and not lost:
            raise self._end
        return Reading(bytes(chunk), count, lost, remark)

    def _receive(self) -> bytes:
        """The next frame. The end of the interface, which the kernel tells before frames that still wait, is noted."""
        try:
            return self._line.recv(LARGEST_FRAME)
        except BlockingIOError:
            raise
        except OSError as error:
            self._end = error
            return self._line.recv(LARGEST_FRAME)

    def close(self) -> None:
        """Close the socket."""
        self._line.close()


class SocketCanAdapter:
    """An interface by its name, such as can0."""

    def __init__(self, interface: str) -> None:
        self.interface = interface

    def open(self) -> SocketCanPort:
        """Bind to the interface. Raises GatewayError with the mend."""
        try:
            line = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except OSError as error:
            raise GatewayError(f"can {self.interface}: this kernel has no CAN: sudo modprobe can_raw") from error
        try:
            prepare(line, RECEIVE_BYTES)
            line.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
            line.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, CONTROLLER | BUS_OFF)
            line.bind((self.interface,))
            trouble = line.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)  # how a raw socket says that it is down
        except OSError as error:
            trouble = error.errno or errno.EIO
        if trouble:
            line.close()
            mend = MENDS.get(trouble, os.strerror(trouble)).format(self.interface)
            raise GatewayError(f"can {self.interface}: {mend}")
        return SocketCanPort(line)
