"""CAN interfaces of the guest's kernel: pretend ones, one behind a serial line, and ports of a real controller."""

import contextlib
import fcntl
import os
import pty
import socket
import struct
import subprocess
import time
import tty
from collections.abc import Iterable, Iterator

from tests.rig.machine import modprobe
from tests.rig.words import Frame

N_SLCAN = 17  # linux/tty.h
TIOCSETD, SIOCGIFNAME = 0x5423, 0x8910
CLASSIC_MTU, FD_MTU = "16", "72"
EXTENDED, ERROR = 0x8000_0000, 0x2000_0000
PORTS = ("can0", "can1")


def ip(*arguments: str) -> None:
    """`ip link ...`, or CalledProcessError."""
    subprocess.run(["ip", "link", *arguments], check=True)


@contextlib.contextmanager
def vcan(name: str = "vcan0", mtu: str = FD_MTU) -> Iterator[None]:
    """A virtual CAN interface, up; leaving deletes it."""
    modprobe("vcan", "can-raw")
    ip("add", name, "mtu", mtu, "type", "vcan")
    try:
        ip("set", name, "up")
        yield
    finally:
        ip("del", name)


@contextlib.contextmanager
def slcan() -> Iterator[tuple[str, int]]:
    """The kernel's interface on a serial line: its name, up, and the bridge's end of the line, to write text to."""
    modprobe("slcan", "can-raw")
    bridge, line = pty.openpty()
    try:
        tty.setraw(line)
        fcntl.ioctl(line, TIOCSETD, struct.pack("i", N_SLCAN))
        name = fcntl.ioctl(line, SIOCGIFNAME, bytes(16)).rstrip(b"\0").decode()
        ip("set", name, "up")
        os.set_blocking(bridge, False)  # slcan never wakes a writer that waits for room
        yield name, bridge
    finally:
        os.close(line)
        os.close(bridge)


@contextlib.contextmanager
def linked_ports() -> Iterator[None]:
    """`PORTS`, two SJA1000 controllers on one bus of 1 Mbit/s, up."""
    modprobe("kvaser_pci", "can-raw")
    for name in PORTS:
        ip("set", name, "type", "can", "bitrate", "1000000")
        ip("set", name, "txqueuelen", "1000", "up")
    try:
        yield
    finally:
        for name in PORTS:
            ip("set", name, "down")


def send(interface: str, frames: Iterable[Frame], *, fd: bool = False) -> None:
    """Send frames as any other program would."""
    form = "=IBBxx64s" if fd else "=IBBxx8s"
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as line:
        line.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        line.bind((interface,))
        for identifier, data in frames:
            line.send(
                struct.pack(form, identifier if identifier & ERROR else EXTENDED | identifier, len(data), 0, data)
            )


def slcan_text(frames: Iterable[Frame]) -> bytes:
    """Frames as the text of a serial CAN bridge."""
    return b"".join(f"T{identifier:08X}{len(data)}{data.hex()}\r".encode() for identifier, data in frames)


def write_line(bridge: int, text: bytes) -> None:
    """Write all of it to a line that does not wait, as fast as it is taken."""
    while text:
        try:
            text = text[os.write(bridge, text) :]
        except BlockingIOError:
            time.sleep(0.01)
