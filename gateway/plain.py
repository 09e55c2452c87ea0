"""Packets of which there is nothing to say, many at once: in hours of replay they are nearly all.

A packet is plain if it follows the one before of its bridge without a gap or a flag, and is a heartbeat, or carries
words of a channel in use, cannot end a sweep, and has room among the words that wait. What is done with plain packets
here is what `gateway.listening` does with any packet one by one, which all others are left to.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from decoders import formats as f
from decoders.framing import Packets, columns
from decoders.kernels_link import ENTRY_BYTES, MOST_WORDS, entries
from decoders.racklink import COUNT, Joined
from gateway.channels import Channel429, Channel708
from gateway.chunks import MONOTONIC_NS, Chunks
from gateway.link import GOES_BACK_NS, SEQUENCE_RANGE, Link
from gateway.timebase import begins_anew, follow
from monitor import scans

LATEST_DEVICE_NS: Final = 1 << 62  # far beyond any clock, and far from overflow
CHANNELS: Final = 256  # of a link
CAREFUL: Final = -1  # instead of a slot
NEVER_NS: Final = np.iinfo(np.int64).max
HEARTBEAT: Final = f.HEARTBEAT
BEAT_BYTES: Final = COUNT.size
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
    """How packets may be taken: each channel in use whose packets may be plain has a slot, which is a place in (n,)."""

    channels: list[tuple[Link, int, Channel429 | Channel708]]
    slot: NDArray[np.int16]  # (links, CHANNELS), or CAREFUL
    is_radar: NDArray[np.bool_]
    end_ns: NDArray[np.int64]  # of the words that wait
    until_ns: NDArray[np.int64]  # from when on none can join them


class Laid(NamedTuple):
    """The words of plain packets, those of a slot one behind the other: `time_ns` i8 (m,) device clock, `sent_ns`.

    Those of slot k are from place `rows[k, 0]` to `rows[k, 1]`; then come packets that are malformed, and words of them
    that are left out. `radar` are the bytes of radar words and `radar_ns` when they were sent by the common clock.
    """

    time_ns: NDArray[np.int64]
    sent_ns: NDArray[np.int64]
    words: NDArray[np.uint32]
    rows: NDArray[np.int64]
    radar_ns: NDArray[np.int64]
    radar: NDArray[np.uint8]

    def of(self, slot: int) -> Joined:
        """The words of a slot of ARINC 429."""
        begin, end, malformed, left_out = self.rows[slot].tolist()
        return Joined(self.time_ns[begin:end], self.sent_ns[begin:end], self.words[begin:end], malformed, left_out)


def framed(links: Sequence[Link], numbers: NDArray[np.int64], chunks: Chunks) -> Batch:
    """The packets that chunks complete; `numbers` (n,) has which of the links each came from."""
    if not len(chunks):
        return Batch(columns([], []), *np.empty((3, 0), np.int64))
    parts, link, record, base = [], [], [], 0
    for number in np.flatnonzero(np.bincount(numbers)).tolist():
        own = np.flatnonzero(numbers == number)
        part = links[number].framer.frame(*chunks.stream(own))
        parts.append(part._replace(start=part.start + base))
        link.append(np.full(len(part.header), number))
        record.append(own[part.chunk])
        base += len(part.data)
    packets = Packets(*map(_joined, zip(*parts, strict=True)))
    links_of, records_of = _joined(link), _joined(record)
    if len(parts) > 1:
        order = np.argsort(records_of, kind="stable")
        links_of, records_of = links_of[order], records_of[order]
        packets = packets.of(order)
    return Batch(packets, links_of, records_of, chunks.columns[MONOTONIC_NS].astype(np.int64)[records_of])


def _joined(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Arrays one behind the other; of one alone no copy is made."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


@njit(cache=True)
def take_plain(  # type: ignore[no-untyped-def] # typed by Listener
    header, start, size, data, link, host_ns, slots, is_radar, end_ns, until_ns, awake, sequence, latest_ns,
    clocks, reference, last, radar_bits, room, longest_wait_ns, newest, arrived,
):  # fmt: skip
    """Take the packets in front that are plain. State as of the last of them is left in the arrays that came with it.

    By slot `newest` i8 (n,) gets the last packet, or -1. A row of `arrived` i8 (m, n + 1) tells a heartbeat and how
    many words came before it and behind the one before; the row behind the last one tells how many came since.
    Gives how many packets and how many heartbeats these are, the common time of the last words, and what makes a
    `Laid`.
    """
    total, told, offset_ns = np.zeros_like(newest), np.zeros_like(newest), np.empty(header.size, np.int64)
    newest[:] = -1
    count = beats = now_ns = 0
    for i in range(header.size):
        of, channel, time_ns = link[i], header[i].channel, np.int64(header[i].time_ns)
        if (
            header[i].flags
            or header[i].sequence != sequence[of]
            or not awake[of]
            or not 0 <= time_ns <= LATEST_DEVICE_NS
        ):
            break
        if header[i].type == HEARTBEAT:
            if size[i] % BEAT_BYTES or beats == arrived.shape[0] - 1:
                break
            arrived[beats, 0], arrived[beats, 1:] = i, total - told
            told[:] = total
            beats += 1
        else:
            slot = slots[of, channel]
            if slot < 0 or time_ns < latest_ns[of] - GOES_BACK_NS or begins_anew(clocks, of, time_ns, host_ns[i]):
                break
            if is_radar[slot]:
                if total[slot] == room or not _goes_on(header[i], start[i], size[i], data, last, radar_bits):
                    break
                total[slot] += 1
            else:
                if not _joins(header[i], size[i], end_ns[slot], until_ns[slot]):
                    break
                if until_ns[slot] == NEVER_NS:
                    until_ns[slot] = time_ns + longest_wait_ns
                end_ns[slot] = time_ns + _little(data, start[i] + size[i] - ENTRY_BYTES, 4)
                total[slot] += size[i] // ENTRY_BYTES
            offset_ns[i] = follow(clocks, reference, of, time_ns, host_ns[i])[0]
            newest[slot], latest_ns[of], now_ns = i, time_ns, time_ns + offset_ns[i]
        sequence[of] = (sequence[of] + 1) % SEQUENCE_RANGE
        count += 1
    arrived[beats, 1:] = total - told
    laid = _laid(header[:count], start, size, data, link, slots, is_radar, offset_ns, total, radar_bits)
    return count, beats, now_ns, laid


@njit(cache=True)
def _joins(header, size, end_ns, until_ns):  # type: ignore[no-untyped-def] # typed by take_plain
    """Whether a packet is of whole words of ARINC 429 that can join those that wait."""
    whole = ENTRY_BYTES <= size <= MOST_WORDS * ENTRY_BYTES and size % ENTRY_BYTES == 0
    return header.type == WORDS_429 and whole and end_ns <= np.int64(header.time_ns) < until_ns


@njit(cache=True)
def _goes_on(header, start, size, data, last, radar_bits):  # type: ignore[no-untyped-def] # typed by take_plain
    """Whether a packet is a whole radar word that goes on with its sweep; then it is the one to go on from."""
    if header.type != WORD_708 or size != COUNT_BYTES + (radar_bits + 7) // 8:
        return False
    time_ns, bits = np.int64(header.time_ns), _little(data, start + COUNT_BYTES, 8)
    if _little(data, start, COUNT_BYTES) != radar_bits or not scans.goes_on(last, time_ns, bits):
        return False
    scans.follow(last, time_ns, bits)
    return True


@njit(cache=True)
def _laid(  # type: ignore[no-untyped-def] # typed by take_plain
    header, start, size, data, link, slots, is_radar, offset_ns, total, radar_bits
):
    """What makes a `Laid` of plain packets, of which each slot has so many words in total."""
    rows, words, radials, width = np.zeros((total.size, 4), np.int64), 0, 0, (radar_bits + 7) // 8
    for slot in range(total.size):
        rows[slot, :2] = words
        if is_radar[slot]:
            radials += total[slot]
        else:
            words += total[slot]
    time_ns, sent_ns, word = np.empty(words, np.int64), np.empty(words, np.int64), np.empty(words, np.uint32)
    radar_ns, radar, radial = np.empty(radials, np.int64), np.empty(radials * width, np.uint8), 0
    for i in range(header.size):
        if header[i].type == HEARTBEAT:
            continue
        device_ns, slot = np.int64(header[i].time_ns), slots[link[i], header[i].channel]
        if is_radar[slot]:
            radar_ns[radial] = device_ns + offset_ns[i]
            piece, place = (
                data[start[i] + COUNT_BYTES : start[i] + size[i]],
                radar[radial * width : (radial + 1) * width],
            )
            for k in range(width):  # assigned as a whole they would be looked at for overlap, which takes longer
                place[k] = piece[k]
            radial += 1
        else:
            rows[slot, 1], malformed, left_out = entries(
                data, start[i], size[i], device_ns, offset_ns[i], time_ns, sent_ns, word, rows[slot, 1]
            )
            rows[slot, 2] += malformed
            rows[slot, 3] += left_out
    return time_ns, sent_ns, word, rows, radar_ns, radar


@njit(cache=True)
def _little(data: NDArray[np.uint8], at: Int, size: Int) -> Int:
    """A little-endian integer; of eight bytes a signed one."""
    value = np.int64(0)
    for k in range(size):
        value |= np.int64(data[at + k]) << (8 * k)
    return value
