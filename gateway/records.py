"""What the recording holds, in the order it happened: raw chunks, statuses, ticks and notes.

Named tuples: hours of them are read back, and a frozen dataclass takes twice as long to make.
"""

from typing import NamedTuple


class Stamp(NamedTuple):
    """When something happened: the host's monotonic clock for order and intervals, its UTC for people."""

    monotonic_ns: int
    utc_ns: int


class Raw(NamedTuple):
    """Bytes as an adapter read them, and what was lost just before: bytes of a stream, or frames, or datagrams."""

    sequence: int
    stamp: Stamp
    adapter: str
    data: bytes
    dropped_before: int = 0


class Status(NamedTuple):
    """A change of state of an adapter or of a part of the gateway."""

    sequence: int
    stamp: Stamp
    adapter: str
    state: str
    reason: str = ""


class Tick(NamedTuple):
    """Time passed: the only clock of everything that follows the recording."""

    sequence: int
    stamp: Stamp


class Note(NamedTuple):
    """A remark on the recording itself, such as a step of UTC."""

    sequence: int
    stamp: Stamp
    text: str


Record = Raw | Status | Tick | Note
