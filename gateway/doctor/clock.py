"""Whether UTC in a recording can be trusted: the kernel itself knows if something keeps its clock."""

import ctypes
import os
from typing import ClassVar, NamedTuple

from gateway.doctor.finding import Finding

TIME_ERROR = 5  # adjtimex(2): the clock is not synchronised, or what synchronises it has failed
STA_UNSYNC = 0x40
MEND = "sudo apt install chrony, and keep `rtcsync` in /etc/chrony/chrony.conf, by which the kernel is told"


class KernelClock(NamedTuple):
    """What adjtimex returns, its status bits and the largest error in us."""

    state: int
    status: int
    largest_error_us: int


class _Timex(ctypes.Structure):
    """The beginning of `struct timex`, and room for the rest of it."""

    _fields_: ClassVar = [
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_long * 32),
    ]


def kernel_clock() -> KernelClock:
    """Ask the kernel, changing nothing. Raises OSError where a sandbox forbids even that."""
    timex = _Timex(modes=0)
    state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    if state < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return KernelClock(state, timex.status, timex.maxerror)


def synchronised(clock: KernelClock) -> Finding:
    """Whether something keeps the clock."""
    good = clock.state != TIME_ERROR and not clock.status & STA_UNSYNC
    seen = f"synchronised to {clock.largest_error_us / 1e3:.1f} ms" if good else "the kernel says: not synchronised"
    return Finding("clock", good, seen, MEND)


def host_clock() -> Finding:
    """The clock of this machine."""
    try:
        return synchronised(kernel_clock())
    except OSError as error:
        return Finding("clock", False, f"the kernel does not say: {error.strerror}", MEND)
