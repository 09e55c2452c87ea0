"""Bridges on a vendor's bulk endpoint, through pyusb and a libusb that sees plugging in without udev."""

import contextlib
import errno
from collections.abc import Iterator
from typing import Any
from urllib.parse import unquote

import libusb_package
import usb.core
import usb.util

from gateway.adapters import NOTHING, Reading, stream
from gateway.config import AdapterConfig
from gateway.errors import GatewayError

LONGEST_WAIT_MS = 200  # so that a silent line still notices the order to stop
READ_PACKETS = 32  # of the endpoint's size, 16 KiB at high speed: a device that never pauses waits for so much
VENDOR_CLASS = 0xFF
MOST_STALLS = 10  # in a row, until the device is given up and opened anew

get_backend = libusb_package.get_libusb1_backend

MENDS = {
    errno.EACCES: "no permission: see `shadebus doctor` for the udev rule",
    errno.EBUSY: "in use: another program holds the interface",
}


class UsbPort:
    """A claimed interface."""

    def __init__(self, device: Any, interface: Any, endpoint: Any) -> None:
        self._device = device
        self._interface = interface
        self._endpoint = endpoint
        self._stalls = 0

    def read(self) -> Reading:
        """Whatever has come, up to 32 packets. Raises USBError once the device has gone."""
        try:
            data = self._endpoint.read(READ_PACKETS * self._endpoint.wMaxPacketSize, LONGEST_WAIT_MS)
        except usb.core.USBTimeoutError:
            return NOTHING
        except usb.core.USBError as error:
            if error.errno == errno.EPIPE and self._stalls < MOST_STALLS:
                self._stalls += 1
                self._endpoint.clear_halt()
                return Reading(b"", 0, 0, "the endpoint had stalled and goes on")
            if error.errno == errno.EOVERFLOW:
                return Reading(b"", 0, 0, "the device sent more than a packet holds; what it sent is lost")
            raise
        self._stalls = 0
        return stream(data.tobytes())

    def close(self) -> None:
        """Release the interface; a device that has gone may object."""
        with contextlib.suppress(Exception):
            usb.util.release_interface(self._device, self._interface)
        with contextlib.suppress(Exception):
            usb.util.dispose_resources(self._device)


class UsbAdapter:
    """A device by vendor, product, serial number if it is given, and interface."""

    def __init__(self, vendor: int, product: int, serial: str | None, interface: int | None) -> None:
        self.vendor = vendor
        self.product = product
        self.serial = serial
        self.interface = interface

    @property
    def name(self) -> str:
        """The device as messages call it."""
        return f"usb {self.vendor:04x}:{self.product:04x}" + (f":{self.serial}" if self.serial else "")

    def open(self) -> UsbPort:
        """Find and claim the interface. Raises GatewayError with the mend."""
        devices = list(self._devices())
        if not devices:
            raise GatewayError(f"{self.name}: no such device: plug it in, or see `shadebus devices` for its name")
        if len(devices) > 1:
            raise GatewayError(f"{self.name}: {len(devices)} such devices: add the serial number, VID:PID:SERIAL")
        device = devices[0]
        try:
            interface, endpoint = self._endpoint(device)
            with contextlib.suppress(NotImplementedError):
                if device.is_kernel_driver_active(interface.bInterfaceNumber):
                    device.detach_kernel_driver(interface.bInterfaceNumber)
            usb.util.claim_interface(device, interface)
        except usb.core.USBError as error:
            usb.util.dispose_resources(device)
            raise GatewayError(f"{self.name}: {MENDS.get(error.errno or 0, error)}") from error
        return UsbPort(device, interface, endpoint)

    def _devices(self) -> Iterator[Any]:
        """The devices that are meant; one whose serial number cannot be read is not another's."""
        found = usb.core.find(find_all=True, idVendor=self.vendor, idProduct=self.product, backend=get_backend())
        for device in found or ():
            try:
                meant = self.serial is None or device.serial_number == self.serial
            except (usb.core.USBError, ValueError) as error:
                raise GatewayError(f"{self.name}: {MENDS.get(getattr(error, 'errno', 0) or 0, error)}") from error
            if meant:
                yield device

    def _endpoint(self, device: Any) -> tuple[Any, Any]:
        """The interface that is meant, or else the first of a vendor's class, and its bulk IN endpoint."""
        try:
            configuration = device.get_active_configuration()
        except usb.core.USBError:  # nobody has configured it yet
            device.set_configuration()
            configuration = device.get_active_configuration()
        for interface in configuration:
            number, of_vendor = interface.bInterfaceNumber, interface.bInterfaceClass == VENDOR_CLASS
            if number == self.interface or (self.interface is None and of_vendor):
                endpoint = usb.util.find_descriptor(interface, custom_match=_is_bulk_in)
                if endpoint is not None:
                    return interface, endpoint
        which = "of a vendor's class" if self.interface is None else f"number {self.interface}"
        raise GatewayError(f"{self.name}: no interface {which} has a bulk IN endpoint")


def _is_bulk_in(endpoint: Any) -> bool:
    address, attributes = endpoint.bEndpointAddress, endpoint.bmAttributes
    incoming = usb.util.endpoint_direction(address) == usb.util.ENDPOINT_IN
    return bool(incoming and usb.util.endpoint_type(attributes) == usb.util.ENDPOINT_TYPE_BULK)


def make(address: str, config: AdapterConfig) -> UsbAdapter:  # noqa: ARG001 # every kind is made alike
    """The adapter of `usb:VID:PID`, `usb:VID:PID:SERIAL` or either with `/INTERFACE`, numbers in hexadecimal.

    A `/` inside a serial number is written %2F. Raises GatewayError for any other address.
    """
    device, _, interface = address.partition("/")
    vendor, _, rest = device.partition(":")
    product, _, serial = rest.partition(":")
    try:
        number = int(interface) if interface else None
        return UsbAdapter(int(vendor, 16), int(product, 16), unquote(serial) or None, number)
    except ValueError as error:
        raise GatewayError(f"usb {address}: write usb:VID:PID, as in usb:1209:7080, and perhaps :SERIAL") from error
