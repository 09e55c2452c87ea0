"""A USB device of the vendor class with one bulk IN endpoint, played by this process through FunctionFS."""

import contextlib
import os
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

from tests.rig.gadget import Gadget
from tests.rig.machine import modprobe

VENDOR, PRODUCT = 0x1209, 0x7080
MOUNT = Path("/run/functionfs")
DESCRIPTORS_MAGIC_V2, STRINGS_MAGIC = 3, 2  # linux/usb/functionfs.h
HAS_FULL_SPEED, HAS_HIGH_SPEED = 1, 2
VENDOR_CLASS, BULK, ENDPOINT_1_IN = 0xFF, 2, 0x81
FULL_SPEED_PACKET, HIGH_SPEED_PACKET = 64, 512


def _function(packet_bytes: int) -> bytes:
    interface = struct.pack("<BBBBBBBBB", 9, 4, 0, 0, 1, VENDOR_CLASS, 0, 0, 1)
    endpoint = struct.pack("<BBBBHB", 7, 5, ENDPOINT_1_IN, BULK, packet_bytes, 0)
    return interface + endpoint


def _descriptors() -> bytes:
    body = struct.pack("<II", 2, 2) + _function(FULL_SPEED_PACKET) + _function(HIGH_SPEED_PACKET)
    return struct.pack("<III", DESCRIPTORS_MAGIC_V2, 12 + len(body), HAS_FULL_SPEED | HAS_HIGH_SPEED) + body


def _strings() -> bytes:
    body = struct.pack("<H", 0x409) + b"words\0"
    return struct.pack("<IIII", STRINGS_MAGIC, 16 + len(body), 1, 1) + body


class BulkBridge:
    """The device's own side: plug, send, unplug."""

    def __init__(self, gadget: Gadget, endpoint: int) -> None:
        self.plug = gadget.plug
        self.unplug = gadget.unplug
        self._endpoint = endpoint

    def send(self, data: bytes) -> None:
        """One transfer, taken when this returns; waits for a reader. OSError while the device is unplugged."""
        os.write(self._endpoint, data)


@contextlib.contextmanager
def bulk_bridge(serial_number: str = "bulk-1") -> Iterator[BulkBridge]:
    """The device, plugged in."""
    modprobe("dummy_hcd", "libcomposite", "usb_f_fs")
    gadget = Gadget(VENDOR, PRODUCT, serial_number, "ffs.words")
    MOUNT.mkdir()
    subprocess.run(["mount", "-t", "functionfs", "words", MOUNT], check=True)
    control = os.open(MOUNT / "ep0", os.O_RDWR)
    os.write(control, _descriptors())
    os.write(control, _strings())
    endpoint = os.open(
        MOUNT / "ep1", os.O_RDWR | os.O_NONBLOCK
    )  # an error while unplugged; it waits for readers anyway
    gadget.plug()
    try:
        yield BulkBridge(gadget, endpoint)
    finally:
        gadget.unplug()  # before the files go: the kernel would hold on to them
        os.close(endpoint)
        os.close(control)
        subprocess.run(["umount", MOUNT], check=True)
        MOUNT.rmdir()
        gadget.remove()
