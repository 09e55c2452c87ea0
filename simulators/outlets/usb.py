"""A bridge on a pretend USB: real pyusb code in front of a device that exists in this process alone.

`UsbDevice` is the bridge's side, an outlet; `UsbBackend` is the host's side, which behaves as libusb does on Linux.
The device has one vendor-class interface with one bulk IN endpoint, and nothing can be written to it.
"""

import errno
import os
import struct
import threading
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

import usb.backend
import usb.core
import usb.util

from simulators.outlets.base import DRAIN_S, Closed, Closing

VENDOR, PRODUCT = 0x1209, 0x7080
ENDPOINT = 0x81
PACKET_BYTES = 512
FIFO_BYTES = 65_536
CONFIGURATION, INTERFACE = 1, 0
LANGUAGE = 0x0409
STRINGS = {1: "shadebus", 2: "simulated bridge"}  # and 3, the serial number
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
        if not self._plug:
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
    claimed_by: "Handle | None" = None
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


@dataclass(eq=False)
class Handle:
    """An opened device."""

    plug: Plug


def failure(code: int) -> usb.core.USBError:
    """The error that libusb's backend raises for an errno."""
    return usb.core.USBError(os.strerror(code), LIBUSB_CODES[code], code)


class UsbBackend(usb.backend.IBackend):  # type: ignore[misc] # pyusb ships no types
    """Hand it to `usb.core.find(backend=...)`: it lists the devices that are plugged in. It has no way to write."""

    def __init__(self, devices: Sequence[UsbDevice]) -> None:
        super().__init__()
        self._devices = devices

    def enumerate_devices(self) -> Iterator[Plug]:
        """What is plugged in now."""
        return iter([device.plug for device in self._devices if device.plug])

    def get_parent(self, dev: Plug) -> None:
        """No hub."""

    def get_device_descriptor(self, dev: Plug) -> SimpleNamespace:
        """The device descriptor, with bus and address."""
        return SimpleNamespace(
            bLength=18,
            bDescriptorType=usb.util.DESC_TYPE_DEVICE,
            bcdUSB=0x0200,
            bDeviceClass=0,
            bDeviceSubClass=0,
            bDeviceProtocol=0,
            bMaxPacketSize0=64,
            idVendor=VENDOR,
            idProduct=PRODUCT,
            bcdDevice=0x0100,
            iManufacturer=1,
            iProduct=2,
            iSerialNumber=3,
            bNumConfigurations=1,
            bus=1,
            address=dev.address,
            port_number=1,
            port_numbers=(1,),
            speed=usb.util.SPEED_HIGH,
        )

    def get_configuration_descriptor(self, dev: Plug, config: int) -> SimpleNamespace:  # noqa: ARG002
        """The one configuration; raises IndexError past it."""
        _one_only(config)
        return SimpleNamespace(
            bLength=9,
            bDescriptorType=usb.util.DESC_TYPE_CONFIG,
            wTotalLength=25,
            bNumInterfaces=1,
            bConfigurationValue=CONFIGURATION,
            iConfiguration=0,
            bmAttributes=0x80,
            bMaxPower=50,
            extra_descriptors=[],
        )

    def get_interface_descriptor(self, dev: Plug, intf: int, alt: int, config: int) -> SimpleNamespace:  # noqa: ARG002
        """The one interface, of the vendor's class; raises IndexError past it."""
        _one_only(intf, alt, config)
        return SimpleNamespace(
            bLength=9,
            bDescriptorType=usb.util.DESC_TYPE_INTERFACE,
            bInterfaceNumber=INTERFACE,
            bAlternateSetting=0,
            bNumEndpoints=1,
            bInterfaceClass=0xFF,
            bInterfaceSubClass=0,
            bInterfaceProtocol=0,
            iInterface=0,
            extra_descriptors=[],
        )

    def get_endpoint_descriptor(self, dev: Plug, ep: int, intf: int, alt: int, config: int) -> SimpleNamespace:  # noqa: ARG002
        """The one endpoint; raises IndexError past it."""
        _one_only(ep, intf, alt, config)
        return SimpleNamespace(
            bLength=7,
            bDescriptorType=usb.util.DESC_TYPE_ENDPOINT,
            bEndpointAddress=ENDPOINT,
            bmAttributes=usb.util.ENDPOINT_TYPE_BULK,
            wMaxPacketSize=PACKET_BYTES,
            bInterval=0,
            bRefresh=0,
            bSynchAddress=0,
            extra_descriptors=[],
        )

    def open_device(self, dev: Plug) -> Handle:
        """A handle, dead as soon as the device is out."""
        dev.check()
        return Handle(dev)

    def close_device(self, dev_handle: Handle) -> None:
        """Give up what the handle has claimed."""
        if dev_handle.plug.claimed_by is dev_handle:
            dev_handle.plug.claimed_by = None

    def set_configuration(self, dev_handle: Handle, config_value: int) -> None:
        """Take the one configuration."""
        dev_handle.plug.check()
        if config_value != CONFIGURATION:
            raise failure(errno.ENOENT)
        dev_handle.plug.configuration = config_value

    def get_configuration(self, dev_handle: Handle) -> int:
        """The configuration that is set."""
        dev_handle.plug.check()
        return dev_handle.plug.configuration

    def set_interface_altsetting(self, dev_handle: Handle, intf: int, altsetting: int) -> None:
        """Take the one setting."""
        dev_handle.plug.check()
        if (intf, altsetting) != (INTERFACE, 0):
            raise failure(errno.ENOENT)

    def claim_interface(self, dev_handle: Handle, intf: int) -> None:
        """For one handle at a time."""
        dev_handle.plug.check()
        if intf != INTERFACE:
            raise failure(errno.ENOENT)
        if dev_handle.plug.claimed_by not in {None, dev_handle}:
            raise failure(errno.EBUSY)
        dev_handle.plug.claimed_by = dev_handle

    def release_interface(self, dev_handle: Handle, intf: int) -> None:  # noqa: ARG002
        """Give the interface back."""
        dev_handle.plug.check()
        dev_handle.plug.claimed_by = None

    def is_kernel_driver_active(self, dev_handle: Handle, intf: int) -> bool:  # noqa: ARG002
        """No driver takes a vendor's class."""
        dev_handle.plug.check()
        return False

    def clear_halt(self, dev_handle: Handle, ep: int) -> None:  # noqa: ARG002
        """End a stall."""
        dev_handle.plug.check()
        dev_handle.plug.clear_halt()

    def bulk_read(self, dev_handle: Handle, ep: int, intf: int, buff: "array[int]", timeout: int) -> int:  # noqa: ARG002
        """Fill the array in place and return the count; a timeout of 0 ms waits for ever."""
        if ep != ENDPOINT:
            raise failure(errno.ENOENT)
        return dev_handle.plug.read(buff, timeout / 1000 if timeout else threading.TIMEOUT_MAX)

    def ctrl_transfer(
        self,
        dev_handle: Handle,
        bmRequestType: int,  # noqa: N803
        bRequest: int,  # noqa: N803
        wValue: int,  # noqa: N803
        wIndex: int,  # noqa: ARG002, N803
        data: "array[int]",
        timeout: int,  # noqa: ARG002
    ) -> int:
        """Strings; any other request stalls."""
        dev_handle.plug.check()
        kind, index = divmod(wValue, 256)
        strings = STRINGS | {3: dev_handle.plug.serial_number}
        if (bmRequestType, bRequest, kind) != (0x80, 6, usb.util.DESC_TYPE_STRING) or index > len(strings):
            raise failure(errno.EPIPE)
        text = strings[index].encode("utf-16-le") if index else struct.pack("<H", LANGUAGE)
        told = bytes([2 + len(text), usb.util.DESC_TYPE_STRING]) + text
        count = min(len(told), len(data))
        data[:count] = array("B", told[:count])
        return count


def _one_only(*indices: int) -> None:
    if any(indices):
        raise IndexError(f"there is one of each, not {max(indices) + 1}")
