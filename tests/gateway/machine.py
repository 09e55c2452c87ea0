"""A tree like that of /sys, /proc and /dev, for what reads them below a root of its own."""

from pathlib import Path


def put(root: Path, place: str, **files: object) -> None:
    """Write files into a directory of the tree."""
    directory = root / place
    directory.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (directory / name).write_text(f"{text}\n")


def interface(
    root: Path, name: str, flags: int = 0x41, carrier: int = 1, mtu: int = 16, queue: int = 1000, kind: int = 280
) -> None:
    """A network interface, a CAN one if it is not said otherwise."""
    up = {"carrier": carrier} if flags & 1 else {}
    put(root, f"sys/class/net/{name}", type=kind, flags=hex(flags), mtu=mtu, tx_queue_len=queue, **up)


def controller(root: Path, name: str) -> None:
    """Hardware behind an interface."""
    (root / f"sys/class/net/{name}/device").mkdir()


def bridge(root: Path, place: str = "1-1", vendor: str = "1209", device: int = 7) -> None:
    """A device on USB bus 1, a bridge if its vendor is not said otherwise."""
    put(root, f"sys/bus/usb/devices/{place}", idVendor=vendor, idProduct="7080", busnum=1, devnum=device)
    put(root, "dev/bus/usb/001", **{f"{device:03d}": ""})
