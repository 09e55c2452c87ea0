"""Frames to any CAN bus that python-can knows."""

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import can

from simulators.carriers import Frame
from simulators.outlets.base import POLL_S, STALL_S, Closed, Closing

OPTIONS: dict[str, dict[str, Any]] = {
    "udp_multicast": {"hop_limit": 0},  # a simulated bus stays on this machine
}


class CanOutlet(Closing):
    """A node of a bus, such as `virtual`, `udp_multicast` or `socketcan`.

    A bus that takes no frame now, because a queue is full, is tried again until it does. `on_stall` is called once for
    each frame that has to wait for long.
    """

    def __init__(self, interface: str, channel: str, fd: bool = False) -> None:
        """Raises OSError where the bus is not there, and ValueError for an interface that python-can does not know."""
        self.on_stall: Callable[[], None] = lambda: None
        self.place = f"can:{interface}:{channel}{'?fd=true' if fd else ''}"
        try:
            self._bus = can.Bus(channel=channel, interface=interface, fd=fd, **OPTIONS.get(interface, {}))
        except can.CanInterfaceNotImplementedError as error:
            raise ValueError(str(error)) from error
        except can.CanError as error:
            raise OSError(0, str(error)) from error
        self._closing = threading.Event()
        self._lock = threading.Lock()

    def write(self, frame: Frame) -> None:
        """Send one frame, however long the bus takes; raises Closed once `close` was called."""
        message = can.Message(
            arbitration_id=frame.id,
            is_extended_id=frame.extended,
            data=frame.data,
            is_fd=frame.fd,
            bitrate_switch=frame.fd,
        )
        stalled_s = time.monotonic() + STALL_S
        while not self._sent(message):
            if time.monotonic() > stalled_s:
                stalled_s = math.inf
                self.on_stall()

    def close(self) -> None:
        """Leave the bus."""
        if self._closing.is_set():
            return
        self._closing.set()
        with self._lock:
            self._bus.shutdown()

    def _sent(self, message: can.Message) -> bool:
        with self._lock:
            if self._closing.is_set():
                raise Closed(f"{self.place} is closed")
            try:
                self._bus.send(message, POLL_S)
            except can.CanOperationError:  # the full queue of a receiver, or of the system
                self._closing.wait(0.001)
                return False
            return True
