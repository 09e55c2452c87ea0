"""Whether UDP and CAN arrive whole: room in the kernel for bursts, and interfaces that are up."""

from pathlib import Path

from gateway.doctor.finding import Finding
from gateway.kernel_devices import CanInterface, can_interfaces

LEAST_BYTES = {  # by setting of the kernel
    "rmem_max": 4 << 20,  # the most that an adapter gets: a second of a bridge while this machine is busy
    "rmem_default": 212_992,  # the kernel's own, where nobody has made it smaller
}
SYSCTL_FILE = "/etc/sysctl.d/70-shadebus.conf"
LEAST_QUEUE = 256  # frames; a radar word is 31 of the classic ones, which a queue of 10 refuses

RATE = "  # or the bit rate of your bus; for FD add: dbitrate 4000000 fd on"


def socket_buffers(root: Path) -> Finding:
    """Receive buffers that sockets get and may ask for."""
    found = {name: _setting(root, name) for name in LEAST_BYTES}
    seen = ", ".join(f"{name} {size if size is not None else 'hidden'}" for name, size in found.items())
    lacking = {name: least for name, least in LEAST_BYTES.items() if (found[name] or 0) < least}
    text = "".join(f"net.core.{name} = {least}\\n" for name, least in lacking.items())
    mend = f"printf '{text}' | sudo tee {SYSCTL_FILE} && sudo sysctl --load={SYSCTL_FILE}"
    return Finding("socket buffers", not lacking, seen, mend)


def _setting(root: Path, name: str) -> int | None:
    try:
        return int((root / "proc/sys/net/core" / name).read_text())
    except OSError:  # a container does not see it
        return None


def can(root: Path) -> Finding:
    """CAN interfaces, and what keeps them from working."""
    found = can_interfaces(root)
    seen = ", ".join(f"{one.name} {one.state}, queue of {one.queue}" for one in found)
    mend = " && ".join(filter(None, map(can_mend, found)))
    return Finding("CAN interfaces", not mend, seen or "none", mend + (RATE if "bitrate" in mend else ""))


def can_mend(one: CanInterface) -> str:
    """The command that mends an interface, or nothing for one that is well."""
    command = f"sudo ip link set {one.name}"
    queue = f" txqueuelen {LEAST_QUEUE}" if one.queue < LEAST_QUEUE else ""
    if one.state == "bus off":
        return f"{command} type can restart" + (f" && {command}{queue}" if queue else "")
    if one.state == "down":
        rate = "" if one.virtual else " type can bitrate 1000000"
        return f"{command} up{queue}{rate}"
    return f"{command}{queue}" if queue else ""
