"""The host's side of a pretend USB: a backend for pyusb that behaves as libusb does on Linux.

The device has one vendor-class interface with one bulk IN endpoint, and nothing can be written to it.
"""

import errno
import struct
import threading
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import usb.backend
import usb.util

from simulators.outlets.usb.device import CONFIGURATION, PACKET_BYTES, Plug, UsbDevice, failure

VENDOR, PRODUCT = 0x1209, 0x7080
ENDPOINT = 0x81
INTERFACE = 0
LANGUAGE = 0x0409
STRINGS = {1: "shadebus", 2: "simulated bridge"}  # and 3, the serial number


@dataclass(eq=False)
class Handle:
    """An opened device."""

    plug: Plug


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
