"""When words are on their buses, and how the bridge gathers them into packets.

A bus is serial: a word that falls due while another is on the wire waits behind it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decoders.formats import (
    HIGH_SPEED_BIT_NS,
    KIND_429_HIGH,
    KIND_429_LOW,
    LOW_SPEED_BIT_NS,
    WORD_429_BIT_TIMES,
    WORD_708,
    WORD_708_US,
    WORDS_429,
)
from simulators import racklink
from simulators.arinc429 import Words
from simulators.instruments import Channel

Nanoseconds = NDArray[np.int64]

BIT_NS = {KIND_429_HIGH: HIGH_SPEED_BIT_NS, KIND_429_LOW: LOW_SPEED_BIT_NS}
WORD_429_BITS = 32
WORD_708_NS = 1000 * WORD_708_US
BATCH_NS = 10_000_000


@dataclass(frozen=True, order=True)
class Due:
    """What the bridge is to send at `ready_ns`; its first word has begun at `time_ns` by the device clock.

    `lost` is what the bridge gathers and then loses before it can number it.
    """

    ready_ns: int
    channel: int
    type: int
    time_ns: int
    body: bytes
    words: int = 0
    flags: int = 0
    lost: bool = False


@dataclass
class Bus:
    """A serial bus that is busy until `free_ns`."""

    word_ns: int
    free_ns: int = 0

    def starts(self, due_ns: Nanoseconds) -> Nanoseconds:
        """When words (n,) due at those rising times begin: at once, or as soon as the word before has left the wire."""
        if not len(due_ns):
            return due_ns
        behind = np.arange(len(due_ns)) * self.word_ns
        earliest = np.maximum(due_ns, self.free_ns)
        starts: Nanoseconds = np.maximum.accumulate(earliest - behind) + behind
        self.free_ns = int(starts[-1]) + self.word_ns
        return starts


@dataclass
class Line429:
    """One ARINC 429 channel through its bus and the bridge's batching; `until` must be called with rising ends."""

    channel: Channel
    done_ns: int = 0
    _waiting: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        bit_ns = BIT_NS[self.channel.kind]
        self._bus = Bus(WORD_429_BIT_TIMES * bit_ns)
        self._last_bit_ns = WORD_429_BITS * bit_ns

    def until(self, end_ns: int) -> Iterator[Due]:
        """Packets of the words begun before `end_ns`, a multiple of 10 ms: one for every 10 ms that saw words."""
        due, words = self._due(self.done_ns, end_ns)
        self.done_ns = end_ns
        self._waiting += zip(self._bus.starts(due).tolist(), words.tolist(), strict=True)
        batches: dict[int, list[tuple[int, int]]] = {}
        for start, word in self._waiting:
            if start < end_ns:
                batches.setdefault(start // BATCH_NS, []).append((start, word))
        self._waiting = [pair for pair in self._waiting if pair[0] >= end_ns]
        for batch in batches.values():
            yield self._gathered(batch)

    def _due(self, start_ns: int, end_ns: int) -> tuple[Nanoseconds, Words]:
        """Due times and words (n,) of [start, end) in the order in which they queue."""
        times, words = [], []
        for label, interval_s in self.channel.intervals_s.items():
            interval_ns = round(interval_s * 1e9)
            due = np.arange(-(-start_ns // interval_ns), -(-end_ns // interval_ns), dtype=np.int64) * interval_ns
            times.append(due)
            words.append(self.channel.words(label, due / 1e9))
        joined, sent = np.concatenate(times), np.concatenate(words)
        order = np.argsort(joined, kind="stable")
        return joined[order], sent[order]

    def _gathered(self, batch: Sequence[tuple[int, int]]) -> Due:
        first, last = batch[0][0], batch[-1][0]
        body = racklink.words_429([start - first for start, _ in batch], [word for _, word in batch])
        ready = last + self._last_bit_ns
        return Due(ready, self.channel.number, WORDS_429, first, body, len(batch))


@dataclass
class Line708:
    """The radar's bus: one packet a word."""

    channel: int

    def __post_init__(self) -> None:
        self._bus = Bus(WORD_708_NS)

    def words(self, due_ns: Nanoseconds, words: NDArray[np.uint8]) -> Iterator[Due]:
        """Packets of words (n, 200) due at rising times (n,)."""
        for start, word in zip(self._bus.starts(due_ns).tolist(), words, strict=True):
            body = racklink.word_708(word.tobytes())
            yield Due(start + WORD_708_NS, self.channel, WORD_708, start, body, 1)
