"""Whether serial lines can be opened, and whether their adapters wait before they hand bytes on."""

import os
from pathlib import Path
from string import digits

from serial.tools import list_ports

from gateway.doctor.finding import Finding, access_mend, udev_mend

LONGEST_LATENCY_MS = 1
QUICK = 'ACTION=="add|change", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'


def lines() -> Finding:
    """Which lines there are."""
    ports = [port.device for port in list_ports.comports()]
    return Finding("serial lines", True, ", ".join(ports) or "none plugged in")


def permission() -> Finding:
    """Whether this user may open them."""
    closed = [port.device for port in list_ports.comports() if not os.access(port.device, os.R_OK | os.W_OK)]
    if not closed:
        return Finding("serial permission", True, "every line that is there can be opened")
    return Finding("serial permission", False, ", ".join(closed), permission_mend(Path(closed[0])))


def permission_mend(device: Path) -> str:
    """The command that lets this user open a line."""
    return access_mend(device, "serial", f'KERNEL=="{device.name.rstrip(digits)}[0-9]*"')


def latency(root: Path) -> Finding:
    """How long FTDI adapters gather bytes; their drivers begin with 16 ms."""
    timers = sorted((root / "sys/bus/usb-serial/devices").glob("*/latency_timer"))
    waits_ms = {timer.parent.name: int(timer.read_text()) for timer in timers}
    seen = ", ".join(f"{name} waits {wait_ms} ms" for name, wait_ms in waits_ms.items())
    good = all(wait_ms <= LONGEST_LATENCY_MS for wait_ms in waits_ms.values())
    return Finding("serial latency", good, seen or "no FTDI adapter", udev_mend("latency", QUICK))
