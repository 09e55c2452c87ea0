"""Bridges on USB and CAN interfaces, as the kernel lists them; `root` is where its /sys and /dev are."""

from pathlib import Path
from typing import NamedTuple

BRIDGE = "1209:7080"  # vendor and product of a bridge on USB
CAN_TYPE = 280  # ARPHRD_CAN
UP = 0x1  # IFF_UP
FD_MTU = 72  # struct canfd_frame


class CanInterface(NamedTuple):
    """One interface: its state is "up", "down" or, after too many errors, "bus off"."""

    name: str
    state: str
    fd: bool  # takes FD frames as it is set now
    virtual: bool  # no controller behind it, and no bit rate to set
    queue: int  # frames that may wait to be sent


def bridge_nodes(root: Path = Path("/")) -> list[Path]:
    """The device node of each bridge on USB."""
    places = (vendor.parent for vendor in sorted((root / "sys/bus/usb/devices").glob("*/idVendor")))
    return [_node(root, place) for place in places if _id(place) == BRIDGE]


def _id(place: Path) -> str:
    return f"{_said(place / 'idVendor')}:{_said(place / 'idProduct')}"


def _node(root: Path, place: Path) -> Path:
    bus, device = (int(_said(place / name)) for name in ("busnum", "devnum"))
    return root / f"dev/bus/usb/{bus:03d}/{device:03d}"


def can_interfaces(root: Path = Path("/")) -> list[CanInterface]:
    """Every CAN interface by name."""
    places = sorted((root / "sys/class/net").glob("*"))
    return [_interface(place) for place in places if _said(place / "type") == str(CAN_TYPE)]


def _interface(place: Path) -> CanInterface:
    state = "down"
    if int(_said(place / "flags") or "0", 16) & UP:
        state = "bus off" if _said(place / "carrier") == "0" else "up"
    fd = int(_said(place / "mtu") or 0) >= FD_MTU
    return CanInterface(place.name, state, fd, not (place / "device").exists(), int(_said(place / "tx_queue_len") or 0))


def _said(path: Path) -> str:
    """What a file of the kernel says; nothing if it is gone or, like the carrier of a link that is down, refuses."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""
