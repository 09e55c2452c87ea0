"""A bridge on a pretend USB: a device that exists in this process alone, for `backend` to show to pyusb."""

import errno
import os
import threading
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field

import usb.core

from simulators.outlets.base import DRAIN_S, Closed, Closing

PACKET_BYTES = 512
FIFO_BYTES = 65_536
CONFIGURATION = 1
LIBUSB_CODES = {  # of errno, as libusb numbers them
    errno.EIO: -1,
    errno.EINVAL: -2,
    errno.ENODEV: -4,
    errno.ENOENT: -5,
    errno.EBUSY: -6,
    errno.ETIMEDOUT: -7,
    errno.EOVERFLOW: -8,
    errno.EPIPE: -9,
}


class UsbDevice(Closing):
    """A bridge that can be plugged in; `write` puts a unit into its FIFO and never waits.

    A unit for which the FIFO has no room is lost in the device as a whole, and `on_lost` is told of it.
    """

    def __init__(self, serial_number: str = "0001", address: int = 1, fifo_bytes: int = FIFO_BYTES) -> None:
        self.serial_number = serial_number
        self.place = ""  # no other process can open it
        self.on_lost: Callable[[bytes], None] = lambda _: None
        self._fifo_bytes = fifo_bytes
        self._closed = False
        self._address = address
        self._plug: Plug | None = Plug(serial_number, address)

    @property
    def plug(self) -> "Plug | None":
        """What the host sees, while it is plugged in."""
        return self._plug

    def write(self, data: bytes) -> None:
        """Put a unit into the FIFO; while unplugged it vanishes. Raises Closed after `close`."""
        if self._closed:
            raise Closed(f"the USB device {self.serial_number} is closed")
        plug = self._plug
        if plug and not plug.put(data, self._fifo_bytes):
            self.on_lost(data)

    def stall(self) -> None:
        """The endpoint halts: reads fail with EPIPE until the host clears it."""
        if self._plug:
            self._plug.halt()

    def overflow(self) -> None:
        """The next read fails with EOVERFLOW, as if the device had sent more than was asked for; one packet is lost."""
        if self._plug:
            self._plug.overrun()

    def unplug(self, error: int = errno.ENODEV) -> None:
        """Pull it out: a read under way fails with `error` (ENODEV or EIO), the FIFO is gone, and so is the device."""
        if self._plug:
            self._plug.pull(error)
            self._plug = None

    def replug(self) -> None:
        """Put it in again; like a real port, the bus gives another address."""
        if not self._plug and not self._closed:
            self._address += 1
            self._plug = Plug(self.serial_number, self._address)

    def drain(self) -> None:
        """Wait up to a second for the reader to empty the FIFO."""
        if self._plug:
            self._plug.wait_empty(DRAIN_S)

    def close(self) -> None:
        """Drain, then pull it out for good."""
        if not self._closed:
            self.drain()
            self._closed = True
            self.unplug()


@dataclass
class Plug:
    """A device from plugging in to pulling out: its FIFO and the state of its endpoint. Handles die with it."""

    serial_number: str
    address: int
    configuration: int = CONFIGURATION  # the kernel sets the first one at once
    claimed_by: object = None  # the handle that has the interface
    _fifo: bytearray = field(default_factory=bytearray)
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _halted: bool = False
    _overrun: bool = False
    _gone: int = 0  # errno once it is out

    def put(self, data: bytes, limit: int) -> bool:
        """Whether the FIFO took the data."""
        with self._changed:
            if len(self._fifo) + len(data) > limit:
                return False
            self._fifo += data
            self._changed.notify_all()
            return True

    def read(self, into: "array[int]", timeout_s: float) -> int:
        """Fill the array with what there is, at least a byte, and count; raises USBError as libusb does."""
        with self._changed:
            self._changed.wait_for(lambda: self._fifo or self._halted or self._overrun or self._gone, timeout_s)
            self._raise_fault()
            if not self._fifo:
                raise usb.core.USBTimeoutError("Operation timed out", LIBUSB_CODES[errno.ETIMEDOUT], errno.ETIMEDOUT)
            room = len(into) * into.itemsize
            if len(self._fifo) > room and room % PACKET_BYTES:
                self._lose_packet()
            count = min(room, len(self._fifo))
            memoryview(into).cast("B")[:count] = self._fifo[:count]
            del self._fifo[:count]
            self._changed.notify_all()
            return count

    def check(self) -> None:
        """Raise ENODEV once it is out."""
        if self._gone:
            raise failure(errno.ENODEV)

    def halt(self) -> None:
        """Stall the endpoint."""
        self._set(_halted=True)

    def clear_halt(self) -> None:
        """End the stall."""
        self._set(_halted=False)

    def overrun(self) -> None:
        """Send too much once."""
        self._set(_overrun=True)

    def pull(self, error: int) -> None:
        """It is out; a read under way fails with `error`."""
        self._set(_gone=error)

    def wait_empty(self, timeout_s: float) -> None:
        """Wait until the FIFO is empty or the device is out."""
        with self._changed:
            self._changed.wait_for(lambda: not self._fifo or self._gone, timeout_s)

    def _set(self, **state: int) -> None:
        with self._changed:
            vars(self).update(state)
            self._changed.notify_all()

    def _raise_fault(self) -> None:
        if self._gone:
            raise failure(self._gone)
        if self._halted:
            raise failure(errno.EPIPE)
        if self._overrun:
            self._overrun = False
            self._lose_packet()

    def _lose_packet(self) -> None:
        """A packet that does not fit into what the host gave for it."""
        del self._fifo[:PACKET_BYTES]
        raise failure(errno.EOVERFLOW)


def failure(code: int) -> usb.core.USBError:
    """The error that libusb's backend raises for an errno."""
    return usb.core.USBError(os.strerror(code), LIBUSB_CODES[code], code)
