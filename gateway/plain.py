"""Packets of which there is nothing to say, many at once: in hours of replay they are nearly all.

A packet is plain if it carries words of a channel in use, follows the one before of its bridge without a gap or a flag,
cannot end a sweep, and has room among the words that wait. What is done with plain packets here is what
`gateway.listening` does with any packet one by one, which all others are left to.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from decoders import formats as f
from decoders.framing import Packets, columns
from decoders.racklink import ENTRY_429
from gateway.link import GOES_BACK_NS, SEQUENCE_RANGE, Link
from gateway.records import Raw
from gateway.timebase import begins_anew, follow
from monitor import scans

LATEST_DEVICE_NS: Final = 1 << 62  # far beyond any clock, and far from overflow
CHANNELS: Final = 256  # of a link
CAREFUL, WORDS, RADIALS = range(3)  # how the packets of a channel are taken
NEVER_NS: Final = np.iinfo(np.int64).max
ENTRY_BYTES: Final = ENTRY_429.itemsize
MOST_WORDS: Final = f.LINK_MAX_WORDS
WORDS_429: Final = f.WORDS_429
WORD_708: Final = f.WORD_708
COUNT_BYTES: Final = 2  # in front of a radar word

Int = Any  # of whatever width the loop has


class Batch(NamedTuple):
    """Packets of several records in the order of those: of each its link and its record, as indices (n,)."""

    packets: Packets
    link: NDArray[np.int64]
    record: NDArray[np.int64]
    host_ns: NDArray[np.int64]

    def of_records(self, first: int, end: int) -> "Batch":
        """The packets of records from one up to another, whose indices count from the first of them."""
        which = slice(*np.searchsorted(self.record, (first, end)))
        return Batch(self.packets.of(which), self.link[which], self.record[which] - first, self.host_ns[which])

    def rest(self, at: int) -> "Batch":
        """All but the first ones."""
        return Batch(self.packets.of(slice(at, None)), self.link[at:], self.record[at:], self.host_ns[at:])


class Ways(NamedTuple):
    """How packets may be taken, by link and channel (links, CHANNELS)."""

    kind: NDArray[np.uint8]
    end_ns: NDArray[np.int64]  # of the words that wait
    until_ns: NDArray[np.int64]  # from when on none can join them

    @classmethod
    def careful(cls, links: int) -> "Ways":
        """Every packet needs care."""
        shape = links, CHANNELS
        return cls(np.zeros(shape, np.uint8), np.zeros(shape, np.int64), np.full(shape, NEVER_NS))


def framed(links: Sequence[Link], records: Sequence[Raw]) -> Batch:
    """The packets that some records complete, of adapters that `links` has."""
    if not records:
        return Batch(columns([], []), *np.empty((3, 0), np.int64))
    numbers = {link.config.name: number for number, link in enumerate(links)}
    _, stamps, adapters, chunks, _ = zip(*records, strict=True)
    parts, link, record, base = [], [], [], 0
    for adapter in dict.fromkeys(adapters):
        own = [k for k, other in enumerate(adapters) if other == adapter]
        part = links[numbers[adapter]].framer.frame([chunks[k] for k in own])
        parts.append(part._replace(start=part.start + base))
        link.append(np.full(len(part.header), numbers[adapter]))
        record.append(np.array(own)[part.chunk])
        base += len(part.data)
    packets = Packets(*map(_joined, zip(*parts, strict=True)))
    links_of, records_of = _joined(link), _joined(record)
    if len(parts) > 1:
        order = np.argsort(records_of, kind="stable")
        links_of, records_of = links_of[order], records_of[order]
        packets = packets.of(order)
    host_ns = np.array([monotonic_ns for monotonic_ns, _ in stamps], np.int64)[records_of]
    return Batch(packets, links_of, records_of, host_ns)


def _joined(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Arrays one behind the other; of one alone no copy is made."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


@njit(cache=True)
def count_plain(  # type: ignore[no-untyped-def] # typed by Listener
    header, start, size, data, link, host_ns, kind, end_ns, until_ns, sequence, latest_ns, clocks, reference, last,
    radar_bits, room, longest_wait_ns, offset_ns,
):  # fmt: skip
    """How many packets in front are plain. State as of the last of them is left in the arrays that came with it."""
    for i in range(header.size):
        of, channel, time_ns = link[i], header[i].channel, np.int64(header[i].time_ns)
        way = kind[of, channel]
        follows = header[i].sequence == sequence[of] and latest_ns[of] - GOES_BACK_NS <= time_ns
        if way == CAREFUL or header[i].flags or not follows or not 0 <= time_ns <= LATEST_DEVICE_NS:
            return i
        if begins_anew(clocks, of, time_ns, host_ns[i]):
            return i
        body = data[start[i] : start[i] + size[i]]
        if way == WORDS:
            whole = ENTRY_BYTES <= body.size <= MOST_WORDS * ENTRY_BYTES and body.size % ENTRY_BYTES == 0
            if header[i].type != WORDS_429 or not whole or not end_ns[of, channel] <= time_ns < until_ns[of, channel]:
                return i
            if until_ns[of, channel] == NEVER_NS:
                until_ns[of, channel] = time_ns + longest_wait_ns
            end_ns[of, channel] = time_ns + _little(body, body.size - ENTRY_BYTES, 4)
        else:
            whole = body.size == COUNT_BYTES + (radar_bits + 7) // 8 and _little(body, 0, COUNT_BYTES) == radar_bits
            if header[i].type != WORD_708 or not whole or not room:
                return i
            bits = _little(body, COUNT_BYTES, 8)
            if not scans.goes_on(last, time_ns, bits):
                return i
            scans.follow(last, time_ns, bits)
            room -= 1
        offset_ns[i] = follow(clocks, reference, of, time_ns, host_ns[i])[0]
        sequence[of] = (sequence[of] + 1) % SEQUENCE_RANGE
        latest_ns[of] = time_ns
    return header.size


@njit(cache=True)
def gathered(data: NDArray[np.uint8], start: NDArray[np.int64], size: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Pieces of `data`, one behind the other."""
    out = np.empty(size.sum(), np.uint8)
    to = 0
    for i in range(start.size):
        piece, place = data[start[i] : start[i] + size[i]], out[to : to + size[i]]
        for k in range(piece.size):  # assigned as a whole they would be looked at for overlap, which takes longer
            place[k] = piece[k]
        to += size[i]
    return out


@njit(cache=True)
def _little(data: NDArray[np.uint8], at: Int, size: Int) -> Int:
    """A little-endian integer; of eight bytes a signed one."""
    value = np.int64(0)
    for k in range(size):
        value |= np.int64(data[at + k]) << (8 * k)
    return value
