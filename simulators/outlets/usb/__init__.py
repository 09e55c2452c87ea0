"""A bridge on a pretend USB: real pyusb code in front of a device that exists in this process alone."""

from simulators.outlets.usb.backend import PRODUCT, VENDOR, Handle, UsbBackend
from simulators.outlets.usb.device import PACKET_BYTES, Plug, UsbDevice

__all__ = ["PACKET_BYTES", "PRODUCT", "VENDOR", "Handle", "Plug", "UsbBackend", "UsbDevice"]
