"""IRIG 106 Chapter 10: ARINC 429 words as data type 0x38; radar words, without a type of their own, as messages (0x30).

Each channel of each adapter is a Chapter 10 channel of its own, which the setup record names: the recording is read
once to find them and once more for the words. The RTC counts from midnight, a day before the first word, and a time
packet stands before what came in each second. A packet ends with its second, before a gap that is too long, and where
a bridge says that it lost words.
"""

from collections import Counter
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429
from decoders import formats as f
from decoders.health429 import TURNED
from gateway.exports import Job
from gateway.exports import chapter10_layouts as c10
from gateway.link import SPOILT
from gateway.words import Block429, Item, Malformed, Word708

DAY_S = 86_400
SECOND_NS = 1_000_000_000
RTC_NS = SECOND_NS // c10.RTC_HZ
TMATS_CHANNEL, TIME_CHANNEL, FIRST_CHANNEL = 0, 1, 2
MOST = {c10.ARINC_429: 16_384, c10.MESSAGE: 128}  # words of a packet, which may have half a megabyte


class Bus(NamedTuple):
    """A channel of an adapter, and the data type of its words."""

    adapter: str
    channel: int
    kind: int


class Survey(NamedTuple):
    """What a recording holds: by bus the words and what they are read by, and the UTC that the RTC counts from."""

    channels: dict[Bus, int]
    words: Counter[Bus]
    read_by: dict[Bus, str]
    origin_s: int


def bus_of(item: Block429 | Word708) -> Bus:
    """Where the words of an item go."""
    return Bus(item.adapter, item.channel, c10.ARINC_429 if isinstance(item, Block429) else c10.MESSAGE)


def survey(items: Iterable[Item]) -> Survey:
    """Look through all words."""
    words: Counter[Bus] = Counter()
    read_by: dict[Bus, str] = {}
    first_ns: int | None = None
    for item in items:
        if isinstance(item, Malformed) or (isinstance(item, Block429) and not len(item.words)):
            continue
        bus = bus_of(item)
        if isinstance(item, Block429):
            words[bus] += len(item.words)
            read_by[bus] = item.reading.definitions.name if item.reading else "unknown"
            first_ns = int(item.utc_ns[0]) if first_ns is None else first_ns
        else:
            words[bus] += 1
            read_by[bus] = item.reading.profile.name if item.reading else "unknown"
            first_ns = item.utc_ns if first_ns is None else first_ns
    channels = {bus: FIRST_CHANNEL + k for k, bus in enumerate(sorted(words))}
    return Survey(channels, words, read_by, ((first_ns or 0) // SECOND_NS // DAY_S - 1) * DAY_S)


def setup(found: Survey) -> list[str]:
    """The setup record (TMATS, Chapter 9): a channel of the recorder for each bus."""
    lines = ["G\\PN:shadebus;", "G\\106:13;", "G\\DSI\\N:1;", "G\\DSI-1:shadebus;", "R-1\\ID:shadebus;"]
    lines += [
        f"R-1\\N:{len(found.channels) + 1};",
        f"R-1\\TK1-1:{TIME_CHANNEL};",
        "R-1\\DSI-1:time;",
        "R-1\\CDT-1:TIMEIN;",
    ]
    lines += ["R-1\\TTF-1:1;", "R-1\\CHE-1:T;"]
    for n, (bus, channel) in enumerate(found.channels.items(), 2):
        name = f"{bus.adapter}-{bus.channel}"
        lines += [f"R-1\\TK1-{n}:{channel};", f"R-1\\TK4-{n}:{channel};", f"R-1\\DSI-{n}:{name};", f"R-1\\CHE-{n}:T;"]
        if bus.kind == c10.ARINC_429:
            lines += [f"R-1\\CDT-{n}:429IN;", f"R-1\\ABTF-{n}:0;", f"R-1\\NAS\\N-{n}:1;"]
            lines += [f"R-1\\ASN-{n}-1:{bus.channel};", f"R-1\\ANM-{n}-1:{found.read_by[bus]};"]
        else:
            lines += [f"R-1\\CDT-{n}:MSGIN;", f"R-1\\MTF-{n}:0;"]
        lines.append(f"COMMENT: {name} is channel {bus.channel} of {bus.adapter}, read as {found.read_by[bus]};")
    return lines


def export(job: Job, path: Path) -> str:
    """Write the file, a packet at a time."""
    found = survey(job.words())
    with path.open("xb") as file:
        writer = Writer(file, found)
        for item in job.words():
            if isinstance(item, Block429):
                writer.words(item)
            elif isinstance(item, Word708):
                writer.radar(item)
        writer.flush()
    kinds = Counter({kind: sum(n for bus, n in found.words.items() if bus.kind == kind) for kind in MOST})
    job.left_out |= {"unfinished bits of radar words, which are whole bytes here": writer.bits_filled}
    return (
        f"{kinds[c10.ARINC_429]} ARINC 429 words, {kinds[c10.MESSAGE]} radar words"
        f" on {len(found.channels)} channels in {writer.packets} packets"
    )


class _Open:
    """The packet of a channel that is being filled."""

    def __init__(self) -> None:
        self.first = self.last = self.count = self.flags = 0
        self.data = bytearray()

    def takes(self, rtc: int, count: int, most: int) -> bool:
        """Whether words from this time on have a place in it."""
        if not self.count:
            return True
        near = 0 <= rtc - self.last <= c10.LARGEST_GAP and rtc // c10.RTC_HZ == self.first // c10.RTC_HZ
        return near and self.count + count <= most

    def add(self, first: int, last: int, count: int, data: bytes) -> None:
        self.first = self.first if self.count else first
        self.last = last
        self.count += count
        self.data += data


class Writer:
    """Packets to a file, in order: setup record, time, and then each second its time and its words."""

    def __init__(self, file: BinaryIO, found: Survey) -> None:
        self.packets = 0
        self.bits_filled = 0
        self._file = file
        self._found = found
        self._sequences: Counter[int] = Counter()
        self._open = {bus: _Open() for bus in found.channels}
        self._second = 0
        self._timed = -1  # the last second with a time packet
        self._write(TMATS_CHANNEL, c10.TMATS, DAY_S * c10.RTC_HZ, c10.tmats_data(setup(found)))

    def words(self, block: Block429) -> None:
        """Take the words of a block; a long gap, an earlier time or a new second begins a packet."""
        if not len(block.words):
            return
        rtc = self._rtc(block.utc_ns)
        gaps = np.diff(rtc)
        cuts = np.flatnonzero((gaps < 0) | (gaps > c10.LARGEST_GAP) | (np.diff(rtc // c10.RTC_HZ) != 0)) + 1
        swapped = block.orientation == "label_swapped"
        wire = block.words & np.uint32(0xFFFF_FF00) | TURNED[block.words & 0xFF] if swapped else block.words
        high_speed = block.reading is None or block.reading.kind == f.KIND_429_HIGH
        errors = _errors(block)
        overflow = bool(block.flags & f.FLAG_FIFO_OVERFLOW)
        for start, stop in zip([0, *cuts.tolist()], [*cuts.tolist(), len(rtc)], strict=True):
            part = slice(start, stop)
            first, last = int(rtc[start]), int(rtc[stop - 1])
            packet = self._place(bus_of(block), first, stop - start, overflow and not start)
            before = packet.last if packet.count else first
            entries = np.diff(rtc[part], prepend=before), wire[part], errors[part], block.channel, high_speed
            packet.add(first, last, stop - start, c10.words_429(*entries))

    def radar(self, word: Word708) -> None:
        """Take a radar word of any length as a message."""
        rtc = int(self._rtc(np.array([word.utc_ns]))[0])
        normal = word.reading.profile.word_bits if word.reading else f.WORD_708_BITS
        wrong_length = word.flags & f.FLAG_WORD_LENGTH or word.bit_count != normal
        spoilt = word.flags & (f.FLAG_CODING | f.FLAG_SYNC | f.FLAG_PARITY)
        errors = c10.FORMAT_ERROR * bool(wrong_length) | c10.DATA_ERROR * bool(spoilt)
        self.bits_filled += -word.bit_count % 8
        packet = self._place(bus_of(word), rtc, 1, bool(word.flags & f.FLAG_FIFO_OVERFLOW))
        packet.add(rtc, rtc, 1, c10.message(rtc, word.data, errors))

    def flush(self) -> None:
        """Write every packet that is open, the earliest first."""
        filled = [bus for bus, packet in self._open.items() if packet.count]
        for bus in sorted(filled, key=lambda bus: self._open[bus].first):
            self._close(bus)

    def _rtc(self, utc_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        return (utc_ns - self._found.origin_s * SECOND_NS + RTC_NS // 2) // RTC_NS

    def _place(self, bus: Bus, rtc: int, count: int, overflow: bool) -> _Open:
        """The packet that words of a bus go to."""
        if rtc // c10.RTC_HZ > self._second:
            self.flush()
            self._second = rtc // c10.RTC_HZ
        if overflow or not self._open[bus].takes(rtc, count, MOST[bus.kind]):
            self._close(bus)
        packet = self._open[bus]
        packet.flags |= c10.DATA_OVERFLOW * overflow
        return packet

    def _close(self, bus: Bus) -> None:
        packet = self._open[bus]
        if packet.count:
            data = packet.count.to_bytes(4, "little") + bytes(packet.data)
            self._write(self._found.channels[bus], bus.kind, packet.first, data, packet.flags)
        self._open[bus] = _Open()

    def _write(self, channel: int, kind: int, rtc: int, data: bytes, flags: int = 0) -> None:
        second = rtc // c10.RTC_HZ
        late = 0 <= self._timed - second <= 1  # as the words of a slower bridge are
        if kind not in (c10.TMATS, c10.TIME) and not late:
            self._timed = second
            utc = datetime.fromtimestamp(self._found.origin_s + second, UTC)
            self._write(TIME_CHANNEL, c10.TIME, second * c10.RTC_HZ, c10.time_data(utc))
        self._file.write(c10.packet(channel, kind, self._sequences[channel], rtc, data, flags))
        self._sequences[channel] += 1
        self.packets += 1


def _errors(block: Block429) -> NDArray[np.uint32]:
    """The error bits of each word: its own parity, and what the bridge says of all words of its packet."""
    odd = arinc429.unpack(block.words).parity_ok
    parity = ~odd | bool(block.flags & f.FLAG_PARITY)
    return np.where(parity, c10.PARITY_429, 0).astype(np.uint32) | np.uint32(
        c10.FORMAT_429 * bool(block.flags & SPOILT)
    )
