"""What is plugged in, each with the `source` by which a rack file names it."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import libusb_package
import usb.core
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from gateway.kernel_devices import BRIDGE, can_interfaces

HIDDEN = "no permission to ask for more: see `shadebus doctor`"


class Device(NamedTuple):
    """One device; `id` is vendor and product of a USB device, and what it does not say is empty."""

    source: str
    id: str
    serial_number: str
    description: str


def plugged_in(root: Path = Path("/")) -> tuple[list[Device], list[str]]:
    """All devices, and a sentence for each kind of which there is none; `root` is where /sys and /dev are."""
    bus = (root / "dev/bus/usb").exists()
    kinds = (
        (serial_lines(list_ports.comports(), root), "no serial line is plugged in"),
        (usb_bridges(), f"no USB bridge ({BRIDGE}) is plugged in" if bus else "this machine shows no USB bus"),
        (can_devices(root), "there is no CAN interface"),
    )
    return [one for found, _ in kinds for one in found], [nothing for found, nothing in kinds if not found]


def serial_lines(ports: Iterable[ListPortInfo], root: Path = Path("/")) -> list[Device]:
    """Serial lines, by the name that stays when they are plugged in elsewhere if they have one."""
    lasting = {link.resolve(): link for link in sorted((root / "dev/serial/by-id").glob("*"))}
    return [
        Device(
            f"serial:{lasting.get(Path(port.device).resolve(), port.device)}",
            "" if port.vid is None else f"{port.vid:04x}:{port.pid:04x}",
            port.serial_number or "",
            "" if port.description in ("n/a", port.name) else port.description,  # where it has none of its own
        )
        for port in sorted(ports)
    ]


def usb_bridges(backend: Any = None) -> list[Device]:
    """Bridges with a bulk endpoint of their own; `backend` is pyusb's, libusb if it is not given."""
    backend = backend or libusb_package.get_libusb1_backend()
    if backend is None:  # no libusb for this machine, or no bus that it can open
        return []
    vendor, product = (int(part, 16) for part in BRIDGE.split(":"))
    found = usb.core.find(find_all=True, backend=backend, idVendor=vendor, idProduct=product)
    return [_bridge(device) for device in found or ()]


def _bridge(device: Any) -> Device:
    try:
        number, product = device.serial_number or "", device.product or ""
    except (usb.core.USBError, ValueError):  # pyusb raises either where it may not open the device
        return Device(f"usb:{BRIDGE}", BRIDGE, "", HIDDEN)
    source = f"usb:{BRIDGE}:{quote(number, safe='')}" if number else f"usb:{BRIDGE}"
    return Device(source, BRIDGE, number, product)


def can_devices(root: Path = Path("/")) -> list[Device]:
    """CAN interfaces of the kernel."""
    return [
        Device(f"can:socketcan:{one.name}", "", "", f"{one.state}, {'FD' if one.fd else 'classic'}")
        for one in can_interfaces(root)
    ]
