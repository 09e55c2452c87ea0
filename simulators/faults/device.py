"""Faults inside the bridge or on its buses, before it numbers packets: they reach every kind of line.

What CAN cannot say it does not say: frames of ARINC 429 words have no flags, so a parity error shows in the word alone.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from decoders.formats import (
    FLAG_PARITY,
    FLAG_WORD_LENGTH,
    HIGH_SPEED_BIT_NS,
    LONGEST_WORD_708_BITS,
    WORD_429_BIT_TIMES,
    WORD_708,
    WORD_708_BITS,
    WORDS_429,
)
from simulators import racklink
from simulators.faults import Change
from simulators.scenario import LinkFault
from simulators.schedule import BATCH_NS, Due

WORD_NS = WORD_429_BIT_TIMES * HIGH_SPEED_BIT_NS
BABBLED_WORDS = BATCH_NS // WORD_NS
BABBLING_CHANNEL = 1  # if the fault names none


def _each(kinds: set[int], change: Callable[[Due, Generator], Due]) -> Change:
    """A fault of single packets of these types: `chance` is the share of them that it changes."""

    def fault_of_packets(dues: Iterator[Due], fault: LinkFault, rng: Generator) -> Iterator[Due]:
        for due in dues:
            concerned = due.type in kinds and fault.channel in {None, due.channel} and fault.covers(due.ready_ns)
            yield change(due, rng) if concerned and rng.random() < fault.chance else due

    return fault_of_packets


def _lost(due: Due, _: Generator) -> Due:
    """The device's FIFO has no room; the next packet of the channel says so, and the heartbeat how many words."""
    return replace(due, lost=True)


def _wrong_parity(due: Due, rng: Generator) -> Due:
    """Bit 32 of one of the words turned over."""
    pairs = np.frombuffer(due.body, "<u4").reshape(-1, 2).copy()
    pairs[rng.integers(len(pairs)), 1] ^= np.uint32(1 << 31)
    return replace(due, body=pairs.tobytes(), flags=due.flags | FLAG_PARITY)


def _wrong_length(due: Due, rng: Generator) -> Due:
    """The radar's word cut short or with zeros behind it."""
    bits = int(rng.choice([*range(1, WORD_708_BITS), *range(WORD_708_BITS + 1, LONGEST_WORD_708_BITS + 1)]))
    word = int.from_bytes(due.body[2:], "little") & (1 << bits) - 1
    body = racklink.word_708(word.to_bytes(-(-bits // 8), "little"), bits)
    return replace(due, body=body, flags=due.flags | FLAG_WORD_LENGTH)


def _clock_jump(dues: Iterator[Due], fault: LinkFault, _: Generator) -> Iterator[Due]:
    """The device's clock goes on from `clock_s`: near 0 as after a restart, or far ahead."""
    leap_ns = round((fault.clock_s - fault.start_s) * 1e9)
    for due in dues:
        yield replace(due, time_ns=max(0, due.time_ns + leap_ns)) if fault.covers(due.ready_ns) else due


def _babble(dues: Iterator[Due], fault: LinkFault, rng: Generator) -> Iterator[Due]:
    """The only transmitter of an ARINC 429 bus sends random words without a pause, and none of its own."""
    channel = BABBLING_CHANNEL if fault.channel is None else fault.channel
    ready_ns = round(fault.start_s * 1e9) + BATCH_NS
    for due in dues:
        while ready_ns <= due.ready_ns and fault.covers(ready_ns):
            yield _nonsense(ready_ns, channel, rng)
            ready_ns += BATCH_NS
        if not (due.words and due.channel == channel and fault.covers(due.ready_ns)):
            yield due


def _nonsense(ready_ns: int, channel: int, rng: Generator) -> Due:
    words = rng.integers(2**32, size=BABBLED_WORDS).tolist()
    body = racklink.words_429([WORD_NS * k for k in range(BABBLED_WORDS)], words)
    flags = 0 if all(word.bit_count() % 2 for word in words) else FLAG_PARITY
    return Due(ready_ns, channel, WORDS_429, ready_ns - BATCH_NS, body, BABBLED_WORDS, flags)


FAULTS: dict[str, Change] = {
    "fifo_overflow": _each({WORDS_429, WORD_708}, _lost),
    "parity_errors": _each({WORDS_429}, _wrong_parity),
    "word_length_errors": _each({WORD_708}, _wrong_length),
    "clock_jump": _clock_jump,
    "babble": _babble,
}
