"""Records of makers' interface cards, as `shadebus import` keeps them, to packets.

A chunk holds whole records, byte for byte as the maker's software wrote them; what is no record is skipped and counted.
In radar words bit 0, the first on the wire, is the least significant bit of the first byte, so of the first 16 bits.
"""

import struct
from collections.abc import Iterator
from typing import Any, ClassVar, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from decoders import formats as f
from decoders import vendors as v
from decoders.framing import Packet, PacketFramer
from decoders.profiles import load_profile
from decoders.racklink_can import Block

ENTRY: Final = struct.Struct("<II")  # of an ARINC 429 packet: ns after the packet's time, word
HEAD: Final = struct.Struct("<HH")  # of a SEQRECORD: type, count
TICKS: Final = struct.Struct("<I")  # its time: the low half behind the head, the high half at the end
LATEST_NS: Final = (1 << 63) - 1  # later times, which no clock has, become this one, and the pipeline refuses it
RADAR_LABELS: Final = frozenset(
    int(f"{label:08b}"[::-1], 2) for label in load_profile("arinc708").labels
)  # on the wire
Records = npt.NDArray[Any]  # structured, one of the layouts of `decoders.vendors`


class Span(NamedTuple):
    """The next bytes of a file that belong together, and the card's time in ns if they say one."""

    size: int
    time_ns: int | None


class RecordFramer(PacketFramer):
    """What the layouts have in common. Beside the bytes it counts records that contradict themselves (`bad_records`),
    those of other buses (`foreign_records`), and repetitions that the card has told of instead of recording them.
    """

    NAMES: ClassVar = (*PacketFramer.NAMES, "bad_records", "foreign_records", "repetitions_untold")
    announces: ClassVar = False

    def __init__(self, reading: v.Reading, channel: int = 0) -> None:
        """`channel` is the one of all words, where the records do not say any."""
        super().__init__()
        self.bad_records = self.foreign_records = self.repetitions_untold = 0
        self.reading = reading  # what it was made with
        self._channel = channel
        self._sequence = 0
        self._packets: list[Packet] = []
        self._blocks: dict[int, tuple[int, Block]] = {}  # by channel: flags of its words, and they

    def spans(self, data: bytes, number: int, whole: bool = False) -> list[Span]:
        """The whole records, and other spans, that data begin with; `number` of them came before. The rest is cut off.

        `whole` data are all that there is: nothing comes that could tell more of their last records.
        It does not depend on what was fed, so that a file can be cut where its records end.
        """
        raise NotImplementedError

    def feed(self, data: bytes) -> list[Packet]:
        """The packets of a chunk: first its ARINC 429 words, by channel, then its radar words."""
        self.received += len(data)
        self._packets = []
        framed = self._take(data)
        self.framed += framed
        self.skipped += len(data) - framed
        self._check_books()
        return self._packets

    def _take(self, data: bytes) -> int:
        """Make packets of a chunk; how many bytes were records."""
        raise NotImplementedError

    def _times_ns(self, ticks: npt.NDArray[np.uint64]) -> list[int]:
        return [min(tick * self.reading.tick_ns, LATEST_NS) for tick in ticks.tolist()]

    def _words(self, times_ns: list[int], channels: list[int], flags: list[int], words: list[int]) -> None:
        """Packets of ARINC 429 words with the same flags and in rising time."""
        for time_ns, channel, flag, word in zip(times_ns, channels, flags, words, strict=True):
            before = self._blocks.get(channel)
            if before and (before[0] != flag or not before[1].takes(time_ns)):
                self._flush()
                before = None
            if before is None:
                before = self._blocks[channel] = flag, Block(time_ns, time_ns)
            block = before[1]
            block.last_ns = time_ns
            block.body += ENTRY.pack(time_ns - block.start_ns, word)
        self._flush()

    def _flush(self) -> None:
        for channel, (flags, block) in self._blocks.items():
            self._give(f.WORDS_429, channel, flags, block.start_ns, bytes(block.body))
        self._blocks.clear()

    def _radar(self, channel: int, flags: int, time_ns: int, bits: int, data: bytes) -> None:
        """A packet of a radar word; a number of bits that the record has no room for is a contradiction."""
        if not 0 < bits <= 8 * len(data):
            self.bad_records += 1
            return
        body = bits.to_bytes(2, "little") + data[: (bits + 7) // 8]
        self._give(f.WORD_708, channel, flags, time_ns, body)

    def _give(self, kind: int, channel: int, flags: int, time_ns: int, body: bytes) -> None:
        self._packets.append(Packet(kind, channel, flags, self._sequence & 0xFFFFFFFF, time_ns, body))
        self._sequence += 1


class SeqrecordFramer(RecordFramer):
    """Ballard's sequential records: ARINC 429 and 708 in one file, each record with its channel."""

    def spans(self, data: bytes, number: int, whole: bool = False) -> list[Span]:  # noqa: ARG002 # each says its own time
        """Records, and what lies between them."""
        return [
            Span(size, None if kind not in SIZES else self._time_ns(data, at, size))
            for at, size, kind in _walk(data, whole)
        ]

    def _time_ns(self, data: bytes, at: int, size: int) -> int:
        (low,), (high,) = TICKS.unpack_from(data, at + 4), TICKS.unpack_from(data, at + size - TICKS.size)
        return int(min((high << 32 | low) * self.reading.tick_ns, LATEST_NS))

    def _take(self, data: bytes) -> int:
        framed = 0
        words, radar = bytearray(), bytearray()
        for at, size, kind in _walk(data, whole=True):
            if kind == "garbage":
                self.bad_records += 1
                continue
            framed += size
            if kind == v.SEQRECORD_TYPE_429:
                words += data[at : at + size]
            elif kind == v.SEQRECORD_TYPE_708:
                radar += data[at : at + size]
            else:
                self.foreign_records += 1
        if words:
            self._take_words(np.frombuffer(words, v.SEQRECORD_429))
        if radar:
            self._take_radar(np.frombuffer(radar, v.SEQRECORD_708))
        return framed

    def _take_words(self, records: Records) -> None:
        flags = _flags(records["activity"], self.reading.flags_429)
        self._words(self._record_times_ns(records), _channels(records), flags, records["data"].tolist())

    def _take_radar(self, records: Records) -> None:
        flags = _flags(records["activity"], self.reading.flags_708)
        bits = np.where(records["bit_count"], records["bit_count"], 16 * records["data_count"].astype(np.uint32))
        rows = zip(_channels(records), flags, self._record_times_ns(records), bits.tolist(), strict=True)
        for row, data in zip(rows, records["data"], strict=True):
            self._radar(*row, data.tobytes())

    def _record_times_ns(self, records: Records) -> list[int]:
        high = records["timestamp_high"].astype(np.uint64) << np.uint64(32)
        return self._times_ns(high | records["timestamp"])


Kind = int | Literal["garbage"]
SIZES: Final = {v.SEQRECORD_TYPE_429: v.SEQRECORD_429.itemsize, v.SEQRECORD_TYPE_708: v.SEQRECORD_708.itemsize}


FARTHEST: Final = max(SIZES.values()) + HEAD.size  # behind a record, what tells whether it is one


def _walk(data: bytes, whole: bool) -> Iterator[tuple[int, int, Kind]]:
    """Place, size and type of each record that is whole, and of each stretch of garbage between them.

    Records have no checksum, but each is followed by another, or by nothing. One that is not, is one all the same if
    its layout is known and no record that is followed begins inside it, as it would where a byte was lost. If the data
    are not the `whole` of what there is, the walk ends where that cannot be told yet. Whether a record begins somewhere
    depends on nothing that lies before: data may be cut at any of these places.
    """
    at = garbage = 0
    while at + HEAD.size <= len(data):
        kind, size = _head(data, at)
        end = at + size
        followed = size > 0 and end <= len(data) and _followed(data, end)
        needed = end + (FARTHEST if kind in SIZES else HEAD.size)  # to tell of one that is not
        if size and not followed and not whole and needed > len(data):
            break
        if not size or end > len(data) or not (followed or (kind in SIZES and _intact(data, at, end))):
            at += 1
            continue
        if garbage < at:
            yield garbage, at - garbage, "garbage"
        yield at, size, kind
        at = garbage = end
    if garbage < at:
        yield garbage, at - garbage, "garbage"


def _followed(data: bytes, end: int) -> bool:
    return end == len(data) or _head(data, end)[1] > 0


def _intact(data: bytes, at: int, end: int) -> bool:
    """Whether no record that is followed begins inside data[at:end] behind its first byte."""
    inside = ((k, _head(data, k)[1]) for k in range(at + 1, end))
    return not any(size and k + size > end and _followed(data, k + size) for k, size in inside)


def _head(data: bytes, at: int) -> tuple[int, int]:
    """Type and size of the record that may begin at a place; size 0 if none can."""
    if at + HEAD.size > len(data):
        return 0, 0
    said, count = HEAD.unpack_from(data, at)
    kind, size = said & v.SEQRECORD_TYPE_MASK, count * v.SEQRECORD_COUNT_BYTES
    other = kind in v.SEQRECORD_OTHER_TYPES and v.SEQRECORD_SHORTEST <= size <= v.SEQRECORD_LONGEST
    return kind, size if other or size == SIZES.get(kind) else 0


def _channels(records: Records) -> list[int]:
    return list((records["activity"] >> 8).tolist())


def _flags(said: npt.NDArray[Any], masks: dict[int, int]) -> list[int]:
    """Our flags for each record's bits."""
    flags = np.zeros(len(said), np.uint8)
    for flag, mask in masks.items():
        flags |= np.where(said & said.dtype.type(mask & np.iinfo(said.dtype).max), flag, 0).astype(np.uint8)
    return list(flags.tolist())


class FixedFramer(RecordFramer):
    """Records of one size, one after another."""

    LAYOUT: ClassVar[np.dtype[Any]]

    def spans(self, data: bytes, number: int, whole: bool = False) -> list[Span]:  # noqa: ARG002 # all tell alike
        """The whole records."""
        records = self._whole(data)
        return [Span(self.LAYOUT.itemsize, time_ns) for time_ns in self._record_times_ns(records, number)]

    def _take(self, data: bytes) -> int:
        records = self._whole(data)
        self._take_records(records)
        return len(records) * self.LAYOUT.itemsize

    def _whole(self, data: bytes) -> Records:
        return np.frombuffer(data, self.LAYOUT, len(data) // self.LAYOUT.itemsize)

    def _take_records(self, records: Records) -> None:
        raise NotImplementedError

    def _record_times_ns(self, records: Records, number: int) -> list[int]:  # noqa: ARG002 # each says its own time
        return self._times_ns(records["time_tag"])


class Mxf429Framer(FixedFramer):
    """MAX Technologies' records of one ARINC 429 channel."""

    LAYOUT: ClassVar = v.MXF_A429

    def _take_records(self, records: Records) -> None:
        self.repetitions_untold += int(records["repeat_count"].sum(dtype=np.uint64))
        flags = _flags(records["control"], self.reading.flags_429)
        channels = [self._channel] * len(records)
        self._words(self._record_times_ns(records, 0), channels, flags, records["data"].tolist())


class Mxf708Framer(FixedFramer):
    """MAX Technologies' records of one ARINC 708 channel."""

    LAYOUT: ClassVar = v.MXF_A708

    def _take_records(self, records: Records) -> None:
        self.repetitions_untold += int(records["repeat_count"].sum(dtype=np.uint64))
        flags = _flags(records["control"], self.reading.flags_708)
        bits = [self.reading.size_bits * size for size in records["data_size"].tolist()]
        rows = zip(flags, self._record_times_ns(records, 0), bits, records["data"], strict=True)
        for flag, time_ns, bit_count, data in rows:
            self._radar(self._channel, flag, time_ns, bit_count, data.tobytes())


class Rdr4bFramer(FixedFramer):
    """The file of an RDR-4B: radar words without a time, so they are counted, and their rate is taken as constant.

    Nor has it a mark of where a record begins: behind a byte that is missing, words have labels that no radar sends.
    """

    NAMES: ClassVar = (*RecordFramer.NAMES, "timed_by_count", "words_of_unknown_label")
    LAYOUT: ClassVar = v.RDR4B

    def __init__(self, reading: v.Reading, channel: int = 0) -> None:
        super().__init__(reading, channel)
        self.timed_by_count = self.words_of_unknown_label = 0

    def _take_records(self, records: Records) -> None:
        times_ns = self._record_times_ns(records, self.timed_by_count)
        self.timed_by_count += len(records)
        for time_ns, data in zip(times_ns, map(np.void.tobytes, records["data"]), strict=True):
            self.words_of_unknown_label += data[0] not in RADAR_LABELS
            self._radar(self._channel, 0, time_ns, f.WORD_708_BITS, data)

    def _record_times_ns(self, records: Records, number: int) -> list[int]:
        rate = self.reading.words_per_s
        return [round(1e9 * k / rate) for k in range(number, number + len(records))]


FRAMERS: Final[dict[str, type[RecordFramer]]] = {
    "seqrecord": SeqrecordFramer,
    "mxf429": Mxf429Framer,
    "mxf708": Mxf708Framer,
    "rdr4b": Rdr4bFramer,
}
