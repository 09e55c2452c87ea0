"""What this machine lacks to run on the rack, and how to mend it."""

import grp
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from string import digits
from typing import NamedTuple

from serial.tools import list_ports

from gateway import kernel_cache

FREE_BYTES = 10 << 30  # hours of a full rack
SLOWEST_SYNC_S = 0.5
OPEN_GROUP = "dialout"
LIBRARIES = ("numba", "rasterio", "pyproj", "scipy", "mcap", "serial", "can", "usb", "libusb_package")


class Finding(NamedTuple):
    """One check: what was looked at, whether it is good, what was seen, and the mend if it is not."""

    check: str
    good: bool
    seen: str
    mend: str = ""


def examine(directory: Path) -> list[Finding]:
    """All checks; `directory` is where recordings are to go."""
    checks: tuple[Callable[[], Finding], ...] = (
        _python,
        _libraries,
        _kernel_cache,
        _serial_ports,
        _serial_permission,
        lambda: _room(directory),
        lambda: _disk(directory),
        _clock,
    )
    return [check() for check in checks]


def _python() -> Finding:
    good = (3, 11) <= sys.version_info < (3, 14)
    return Finding("Python", good, platform.python_version(), "use Python 3.11 to 3.13")


def _libraries() -> Finding:
    missing = []
    for name in LIBRARIES:
        try:
            import_module(name)
        except ImportError as error:
            missing.append(f"{name} ({error})")
    return Finding("libraries", not missing, ", ".join(missing) or f"{len(LIBRARIES)} load", "run `make setup` again")


def _kernel_cache() -> Finding:
    place = kernel_cache.place()
    return Finding("kernel cache", place is not None, str(place or "no directory can be written"), kernel_cache.MEND)


def _serial_ports() -> Finding:
    ports = [port.device for port in list_ports.comports()]
    return Finding("serial lines", True, ", ".join(ports) or "none plugged in")


def _serial_permission() -> Finding:
    closed = [port.device for port in list_ports.comports() if not os.access(port.device, os.R_OK | os.W_OK)]
    if not closed:
        return Finding("serial permission", True, "every line that is there can be opened")
    return Finding("serial permission", False, ", ".join(closed), permission_mend(Path(closed[0])))


def permission_mend(device: Path) -> str:
    """The command that lets this user open a device: joining its group, or a udev rule where that is root's."""
    try:
        group = grp.getgrgid(device.stat().st_gid).gr_name
    except (KeyError, OSError):
        group = OPEN_GROUP
    join = f"sudo usermod -aG {OPEN_GROUP if group == 'root' else group} $USER, then log in again"
    if group != "root":
        return join
    rule = f'KERNEL=="{device.name.rstrip(digits)}[0-9]*", GROUP="{OPEN_GROUP}", MODE="0660"'
    load = "sudo udevadm control --reload && sudo udevadm trigger"
    return f"echo '{rule}' | sudo tee /etc/udev/rules.d/70-shadebus.rules && {load} && {join}"


def _room(directory: Path) -> Finding:
    place = next(p for p in (directory.absolute(), *directory.absolute().parents) if p.exists())
    free = shutil.disk_usage(place).free
    return Finding("disk room", free >= FREE_BYTES, f"{free / 2**30:.1f} GiB free at {place}", "make 10 GiB of room")


def _disk(directory: Path) -> Finding:
    place = next(p for p in (directory.absolute(), *directory.absolute().parents) if p.exists())
    try:
        with tempfile.NamedTemporaryFile(dir=place) as file:
            file.write(bytes(1 << 20))
            began = time.monotonic()
            os.fdatasync(file.fileno())
            took_s = time.monotonic() - began
    except OSError as error:
        return Finding("disk writes", False, f"{place}: {error.strerror}", "choose a directory you can write")
    return Finding(
        "disk writes", took_s < SLOWEST_SYNC_S, f"1 MiB synchronised in {took_s * 1e3:.1f} ms", "faster disk"
    )


def _clock() -> Finding:
    synchronised = Path("/run/systemd/timesync/synchronized").exists() or shutil.which("chronyc") is not None
    seen = "a time service is at work" if synchronised else "no sign of systemd-timesyncd or chrony"
    return Finding("clock", synchronised, seen, "sudo apt install chrony, so that UTC in the recording can be trusted")
