"""What this machine lacks to run on the rack, and how to mend it."""

from collections.abc import Callable
from pathlib import Path

from gateway.doctor import clock, disk, machine, network, serial, usb
from gateway.doctor.finding import Finding


def examine(directory: Path, root: Path = Path("/")) -> list[Finding]:
    """All checks; `directory` is where recordings are to go, `root` where /sys, /proc and /dev are."""
    checks: tuple[Callable[[], Finding], ...] = (
        machine.python,
        machine.libraries,
        machine.compiled_kernels,
        serial.lines,
        serial.permission,
        lambda: serial.latency(root),
        lambda: usb.permission(root),
        lambda: network.socket_buffers(root),
        lambda: network.can(root),
        lambda: disk.room(directory),
        lambda: disk.writes(directory),
        clock.host_clock,
    )
    return [check() for check in checks]
