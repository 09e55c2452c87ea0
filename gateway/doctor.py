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
from typing import NamedTuple

from serial.tools import list_ports

FREE_BYTES = 10 << 30  # hours of a full rack
SLOWEST_SYNC_S = 0.5
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
    place = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parent.parent / "monitor")
    good = os.access(place, os.W_OK)
    mend = "set NUMBA_CACHE_DIR to a directory you can write, or every start compiles for half a minute"
    return Finding("kernel cache", good, str(place), mend)


def _serial_ports() -> Finding:
    ports = [port.device for port in list_ports.comports()]
    return Finding("serial lines", True, ", ".join(ports) or "none plugged in")


def _serial_permission() -> Finding:
    closed = [port.device for port in list_ports.comports() if not os.access(port.device, os.R_OK | os.W_OK)]
    if not closed:
        return Finding("serial permission", True, "every line that is there can be opened")
    try:
        group = grp.getgrgid(Path(closed[0]).stat().st_gid).gr_name
    except (KeyError, OSError):
        group = "dialout"
    return Finding("serial permission", False, ", ".join(closed), f"sudo usermod -aG {group} $USER, then log in again")


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
