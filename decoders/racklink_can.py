"""RackLink over CAN: frames to packets. ARINC 429 words of a chunk become blocks, radar words are put together.

CAN has no packet counter: losses are what the bridge's heartbeats say beyond what arrived.
"""

import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Final

from decoders import formats as f
from decoders.can_frames import Frame, FrameReader
from decoders.framing import Packet, PacketFramer

WORD: Final = struct.Struct(f.CAN_429)
COUNTS: Final = struct.Struct(f.CAN_COUNTS)
HEAD_708: Final = struct.Struct(f.CAN_708_HEAD)
ENTRY: Final = struct.Struct("<II")  # of an ARINC 429 packet: ns after the packet's time, word
BLOCK_NS: Final = 1 << 32  # what an entry can span
HALF: Final = 1 << 31
WRAP: Final = 1 << 32


class Clock:
    """The bridge's clock in us, of which a frame has only the low 32 bits; it begins one wrap above zero."""

    def __init__(self) -> None:
        self._us: int | None = None

    def us(self, low: int) -> int:
        """The time nearest to the one before that ends with these bits."""
        before = WRAP + low if self._us is None else self._us
        self._us = max(before + (low - before + HALF) % WRAP - HALF, 0)
        return self._us

    def ns(self, time_ns: int) -> int:
        """A whole device time on this clock."""
        us, rest = divmod(time_ns, 1000)
        return 1000 * self.us(us % WRAP) + rest


@dataclass
class Block:
    """ARINC 429 words of one channel, in rising time."""

    start_ns: int
    last_ns: int
    body: bytearray = field(default_factory=bytearray)

    def takes(self, time_ns: int) -> bool:
        """Whether a word of this time has a place in the block."""
        in_order = self.last_ns <= time_ns < self.start_ns + BLOCK_NS
        return in_order and len(self.body) < f.LINK_MAX_WORDS * ENTRY.size


@dataclass
class Segments:
    """A radar word that is being put together."""

    counter: int
    next_index: int
    data: bytearray


class CanFramer(PacketFramer):
    """Bytes as the adapter records them: those of frames that belong to RackLink are framed, whatever is in them.

    Beside them it counts frames that are not ours (`foreign_frames`), contradict their identifier (`bad_frames`) or
    come twice (`repeated_frames`), and radar words of which a segment is missing (`incomplete_708`).
    """

    FAULTS: ClassVar = (
        "error_frames",
        "foreign_frames",
        "bad_frames",
        "bad_lines",
        "repeated_frames",
        "incomplete_708",
    )
    announces: ClassVar = False

    def __init__(self, reader: FrameReader) -> None:
        super().__init__()
        self._reader = reader
        self._faults: Counter[str] = Counter()
        self._clock = Clock()
        self._blocks: dict[int, Block] = {}
        self._last: dict[int, bytes] = {}  # by channel, the last ARINC 429 frame
        self._segments: dict[int, Segments] = {}
        self._radar: list[tuple[int, int, int, bytes]] = []  # channel, flags, time and body of whole words
        self._packets: list[Packet] = []
        self._sequence = 0
        self._kinds: dict[int, Callable[[int, int, bytes], bool]] = {
            f.CAN_WORD_429: self._word,
            f.CAN_WORD_708: self._segment,
            f.CAN_HEARTBEAT: self._heartbeat,
        }

    @property
    def pending(self) -> int:
        """Bytes of a line of text without its end."""
        return self._reader.pending

    def counters(self) -> dict[str, int]:
        """Every counter by name."""
        faults = self._faults + self._reader.counters
        return super().counters() | {name: faults[name] for name in self.FAULTS}

    def succeed(self, before: PacketFramer) -> None:
        """Take over the counts of a framer that is given up; what it still had pending counts as skipped."""
        self.received, self.framed = before.received, before.framed
        self.skipped = before.skipped + before.pending
        self._faults += Counter({name: before.counters()[name] for name in self.FAULTS})

    def feed(self, data: bytes) -> list[Packet]:
        """The packets of a chunk: first its ARINC 429 words, by channel, then its radar words."""
        self.received += len(data)
        self._packets = []
        before = self._reader.skipped
        for frame in self._reader.feed(data):
            self._take(frame)
        self.skipped += self._reader.skipped - before
        self._flush()
        self._check_books()
        return self._packets

    def _take(self, frame: Frame) -> None:
        identifier = frame.identifier
        take = self._kinds.get(identifier >> 12 & 0xF)
        if identifier >> 24 != f.CAN_PREFIX or take is None:
            self.skipped += frame.size
            self._faults["foreign_frames"] += 1
            return
        self.framed += frame.size
        if not take(identifier >> 16 & 0xFF, identifier & 0xFFF, frame.data):
            self._faults["bad_frames"] += 1

    def _word(self, channel: int, index: int, data: bytes) -> bool:
        if len(data) != WORD.size or data[0] != index:
            return False
        if self._last.get(channel) == data:
            self._faults["repeated_frames"] += 1
            return True
        self._last[channel] = data
        word, low = WORD.unpack(data)
        time_ns = 1000 * self._clock.us(low)
        block = self._blocks.get(channel)
        if block and not block.takes(time_ns):
            self._flush()
            block = None
        if block is None:
            block = self._blocks[channel] = Block(time_ns, time_ns)
        block.last_ns = time_ns
        block.body += ENTRY.pack(time_ns - block.start_ns, word)
        return True

    def _segment(self, channel: int, index: int, data: bytes) -> bool:
        if len(data) < 2:  # a counter and nothing that it counts
            return False
        word = self._segments.pop(channel, None)
        if index == 0:
            self._faults["incomplete_708"] += word is not None
            word = Segments(data[0], 0, bytearray())
        elif word is None or (word.counter, word.next_index) != (data[0], index):
            self._faults["incomplete_708"] += word is not None
            return True  # its beginning is missing, and counted when that was noticed or by the next heartbeat
        word.data += data[1:]
        word.next_index += 1
        if not self._whole(channel, word.data):
            self._segments[channel] = word
        return True

    def _whole(self, channel: int, data: bytearray) -> bool:
        """Give a packet if the word has all its bits; what lies behind them fills up a frame."""
        if len(data) < HEAD_708.size:
            return False
        time_ns, bit_count, flags = HEAD_708.unpack_from(data)
        end = HEAD_708.size + (bit_count + 7) // 8
        if len(data) < end:
            return False
        body = bit_count.to_bytes(2, "little") + bytes(data[HEAD_708.size : end])
        self._radar.append((channel, flags, self._clock.ns(time_ns), body))
        return True

    def _heartbeat(self, channel: int, _index: int, data: bytes) -> bool:
        if len(data) != COUNTS.size:
            return False
        self._flush()  # it comes behind the words that it counts
        self._give(f.HEARTBEAT, channel, 0, 0, bytes([channel]) + data)
        return True

    def _flush(self) -> None:
        for channel, block in self._blocks.items():
            self._give(f.WORDS_429, channel, 0, block.start_ns, bytes(block.body))
        self._blocks.clear()
        for word in self._radar:
            self._give(f.WORD_708, *word)
        self._radar.clear()

    def _give(self, kind: int, channel: int, flags: int, time_ns: int, body: bytes) -> None:
        self._packets.append(Packet(kind, channel, flags, self._sequence % WRAP, time_ns, body))
        self._sequence += 1
