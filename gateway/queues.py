"""A queue between two threads, bounded in bytes: what does not fit is refused, counted, and the giver told."""

import threading
from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

OVERHEAD_BYTES = 300  # what a waiting chunk takes besides its bytes; givers add it, or small chunks would cost nothing

T = TypeVar("T")


@dataclass
class QueueCounters:
    """Items in, out and refused, bytes refused, and the largest number of bytes ever waiting."""

    accepted: int = 0
    taken: int = 0
    refused: int = 0
    refused_bytes: int = 0
    high_water_bytes: int = 0


class ByteQueue(Generic[T]):
    """First in, first out. `put` never waits: a full queue refuses the newest item."""

    def __init__(self, limit_bytes: int) -> None:
        self.counters = QueueCounters()
        self._limit_bytes = limit_bytes
        self._items: deque[tuple[T, int]] = deque()
        self._waiting_bytes = 0
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: T, size_bytes: int) -> bool:
        """Add an item; False if there is no room. Items of size 0 always fit: they are few and tell of trouble."""
        with self._changed:
            if size_bytes and self._waiting_bytes + size_bytes > self._limit_bytes:
                self.counters.refused += 1
                self.counters.refused_bytes += size_bytes
                return False
            self._items.append((item, size_bytes))
            self._waiting_bytes += size_bytes
            self.counters.accepted += 1
            self.counters.high_water_bytes = max(self.counters.high_water_bytes, self._waiting_bytes)
            self._changed.notify()
            return True

    def take(self, timeout_s: float | None = None) -> list[T] | None:
        """All that waits, perhaps nothing after the time-out; None once the queue is closed and empty."""
        with self._changed:
            if not self._items and not self._closed:
                self._changed.wait(timeout_s)
            if not self._items:
                return None if self._closed else []
            items = [item for item, _ in self._items]
            self._items.clear()
            self._waiting_bytes = 0
            self.counters.taken += len(items)
            return items

    def close(self) -> None:
        """No more items come; what waits can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
