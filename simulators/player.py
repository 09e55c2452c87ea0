"""Play traffic in real time, or at any multiple of it."""

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass

from simulators.outlets import Closed, Outlet


@dataclass
class Played:
    """What went out, and how late the worst packet was handed over compared with its device time."""

    packets: int = 0
    size_bytes: int = 0
    worst_lateness_s: float = 0.0


def play(
    traffic: Iterable[tuple[int, bytes]],
    outlet: Outlet,
    speed: float = 1.0,
    stop: threading.Event | None = None,
) -> Played:
    """Write packets when their device time has come on a monotonic clock, never early; `speed` inf does not wait.

    The clock starts when the first packet has gone out. Ends with the traffic, at `stop`, or when the outlet's reader
    leaves; a write that waits for a slow reader is ended by closing the outlet. Raises ValueError for a speed that is
    not positive.
    """
    if not speed > 0:
        raise ValueError(f"speed {speed} must be above 0: 1 is real time, inf does not wait")
    halt = stop or threading.Event()
    played = Played()
    origin: float | None = None
    for time_ns, data in traffic:
        due_s = time_ns * 1e-9 / speed
        if halt.wait(max(0.0, origin + due_s - time.monotonic()) if origin is not None else 0.0):
            break
        try:
            outlet.write(data)
        except Closed:
            break
        if origin is None:  # a TCP outlet has waited for its client until now
            origin = time.monotonic() - due_s
        played.worst_lateness_s = max(played.worst_lateness_s, time.monotonic() - origin - due_s)
        played.packets += 1
        played.size_bytes += len(data)
    return played
