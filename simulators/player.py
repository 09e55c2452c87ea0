"""Play traffic in real time, or at any multiple of it."""

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass

from simulators.carriers import Unit
from simulators.faults.plug import Plug
from simulators.outlets import Closed, Outlet


@dataclass
class Played:
    """What went out (frames, datagrams or lines), and how late the worst was handed over against its device time."""

    units: int = 0
    size_bytes: int = 0
    worst_lateness_s: float = 0.0


def play(
    units: Iterable[tuple[int, Unit | Plug]],
    outlet: Outlet[Unit],
    speed: float = 1.0,
    stop: threading.Event | None = None,
) -> Played:
    """Write units when their device time has come on a monotonic clock, never early; `speed` inf does not wait.

    The clock starts when the first unit has gone out. Ends with the traffic, at `stop`, or when the outlet's reader
    leaves; a write that waits for a slow reader is ended by closing the outlet. What happens to the plug happens to
    the outlet, which must have `drain`, `unplug` and `replug`. Raises ValueError for a speed that is not positive.
    """
    if not speed > 0:
        raise ValueError(f"speed {speed} must be above 0: 1 is real time, inf does not wait")
    halt = stop or threading.Event()
    played = Played()
    origin: float | None = None
    for time_ns, unit in units:
        due_s = time_ns * 1e-9 / speed
        if halt.wait(max(0.0, origin + due_s - time.monotonic()) if origin is not None else 0.0):
            break
        if isinstance(unit, Plug):
            for method in unit.value:
                getattr(outlet, method)()
            continue
        try:
            outlet.write(unit)
        except Closed:
            break
        if origin is None:  # a TCP outlet has waited for its client until now
            origin = time.monotonic() - due_s
        played.worst_lateness_s = max(played.worst_lateness_s, time.monotonic() - origin - due_s)
        played.units += 1
        played.size_bytes += len(unit if isinstance(unit, bytes) else unit.data)
    return played
