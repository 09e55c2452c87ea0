"""The words of a recording in blocks: whose they are, when they were on the bus, and how they are read.

A record's UTC says when a chunk was read, which may be a while after its words. So the UTC of a word is its device
time laid onto the host's clocks by the smallest delay from word to reading (`gateway.timebase`): words of one bridge
lie as far apart in UTC as by the bridge's own clock. What is laid on is held, and moves in one step once it is wrong by
`STEP_NS`, as after a drift of clocks or a step of the host's UTC.
"""

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429
from decoders import formats as f
from decoders.arinc429 import Values429
from decoders.racklink import TIME_LIMIT_NS, MalformedBody, Packet, hello, radar_word, words429
from gateway.channels import Channel429, Channel708
from gateway.config import RackConfig, profile_of
from gateway.link import SPOILT, Link
from gateway.records import Raw, Record, Stamp
from gateway.timebase import Timebase

STEP_NS = 5_000_000
LATEST_NS = 1 << 62  # of a stamp: the year 2116, and far from overflow


class Block429(NamedTuple):
    """The ARINC 429 words (n,) of one packet, and how they are read, if that is known."""

    adapter: str
    channel: int
    flags: int  # as in `formats`
    reading: Channel429 | None
    words: NDArray[np.uint32]
    device_ns: NDArray[np.int64]
    utc_ns: NDArray[np.int64]

    @property
    def orientation(self) -> str:
        """How the label lies in the words; as on the wire where nobody has said."""
        return self.reading.orientation if self.reading else "wire"

    @property
    def why_not_decoded(self) -> str:
        """Why the words have no values, or nothing."""
        if self.flags & SPOILT:
            return "not decoded"
        return "" if self.reading else "channel without definitions"

    def decoded(self) -> Values429 | None:
        """The values of the words, or None where their bits cannot be trusted or nobody has said what they mean."""
        if self.why_not_decoded or self.reading is None:
            return None
        return arinc429.decode(self.words, self.reading.definitions, self.orientation)


class Word708(NamedTuple):
    """One ARINC 708 word of any length, and how it is read, if the channel is a radar's."""

    adapter: str
    channel: int
    flags: int
    reading: Channel708 | None
    bit_count: int
    data: bytes
    device_ns: int
    utc_ns: int


class Malformed(NamedTuple):
    """A packet whose CRC is good and whose body is not what its type says; the UTC is that of reading."""

    adapter: str
    channel: int
    reason: str
    utc_ns: int


Item = Block429 | Word708 | Malformed


class UtcLayer:
    """What to add to device times for UTC: held while it is right to `STEP_NS`, and `steps` counts when it was not."""

    def __init__(self) -> None:
        self.steps = 0
        self._held: dict[str, int] = {}

    def offset_ns(self, clock: str, host_offset_ns: int, stamp: Stamp) -> int:
        """The offset of a clock that is `host_offset_ns` from the host's monotonic clock."""
        utc_ns, monotonic_ns = min(stamp.utc_ns, LATEST_NS), min(stamp.monotonic_ns, LATEST_NS)
        now_ns = host_offset_ns + utc_ns - monotonic_ns
        held_ns = self._held.setdefault(clock, now_ns)
        if abs(now_ns - held_ns) > STEP_NS:
            self.steps += 1
            self._held[clock] = held_ns = now_ns
        return held_ns


class WordStage:
    """Feed it records in order; it gives their words. A packet that came twice is used once, as live."""

    def __init__(self, config: RackConfig) -> None:
        self._links = {a.name: Link(a, profile_of(config.radar_profile)) for a in config.adapters}
        self._timebase = Timebase([*self._links])
        self._utc = UtcLayer()
        self._malformed: Counter[str] = Counter()

    def feed(self, record: Record) -> Iterator[Item]:
        """The words of one record, a block or a radar word each packet."""
        if not isinstance(record, Raw) or record.adapter not in self._links:
            return
        link = self._links[record.adapter]
        for packet in link.framer.feed(record.data):
            if not link.count(packet):
                continue
            try:
                if packet.type == f.HELLO:
                    link.channels |= link.announced(hello(packet))
                elif packet.type == f.WORDS_429:
                    yield self._block(link, packet, record)
                elif packet.type == f.WORD_708:
                    yield self._radar(link, packet, record)
            except MalformedBody as error:
                self._malformed[record.adapter] += 1
                yield Malformed(record.adapter, packet.channel, str(error), min(record.stamp.utc_ns, LATEST_NS))

    def left_out(self) -> dict[str, int]:
        """What of the recorded bytes so far has become no word, by what it is."""
        found = {
            f"bytes of {name} that are no packet": link.framer.skipped + link.framer.pending
            for name, link in self._links.items()
        }
        found |= {f"packets of {name} that contradict their type": count for name, count in self._malformed.items()}
        found |= {
            f"packets of {name} that came twice": link.counters["packets_repeated"]
            for name, link in self._links.items()
        }
        return {what: count for what, count in found.items() if count}

    def _block(self, link: Link, packet: Packet, record: Raw) -> Block429:
        block = words429(packet)
        link.identify(packet)
        channel = link.channels.get(packet.channel)
        reading = channel if isinstance(channel, Channel429) else None
        utc_ns = block.time_ns + self._offset_ns(packet, record)
        here = record.adapter, packet.channel, packet.flags
        return Block429(*here, reading, block.words, block.time_ns, utc_ns)

    def _radar(self, link: Link, packet: Packet, record: Raw) -> Word708:
        word = radar_word(packet)
        if packet.time_ns > TIME_LIMIT_NS:
            raise MalformedBody(f"device time {packet.time_ns} ns does not fit a signed 64-bit count")
        utc_ns = packet.time_ns + self._offset_ns(packet, record)
        here = record.adapter, packet.channel, packet.flags
        return Word708(*here, link.radar(packet.channel), word.bit_count, word.data, packet.time_ns, utc_ns)

    def _offset_ns(self, packet: Packet, record: Raw) -> int:
        self._timebase.offset_ns(record.adapter, packet.time_ns, min(record.stamp.monotonic_ns, LATEST_NS))
        return self._utc.offset_ns(record.adapter, self._timebase.host_offset_ns(record.adapter), record.stamp)
