"""Reads the records of one file, and goes on behind whatever is damaged in it.

After a damaged place reading goes on at the next record that is whole: its CRC is right and its header says the same as
its payload. However the damage lies, the work stays in proportion to its size: a place where a record might begin is
given up on cheap signs first, and what may be spent on CRCs there grows with the bytes passed over.
"""

import re
import struct
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gateway.chunks import COLUMNS, MONOTONIC_NS, NUMBER, UTC_NS, Chunks, Run
from gateway.recording import index
from gateway.recording.kernels import CHANNELS, KNOWN, MESSAGE, RAW_BYTES, raw_records
from gateway.recording.layout import (
    CHANNEL,
    DATA_END,
    HEADER,
    LARGEST_DESCRIPTION,
    LARGEST_RECORD,
    MAGIC,
    METADATA,
    PROFILE,
    RECORD_HEAD,
    DamagedRecord,
    Topic,
    parse_channel,
    parse_metadata,
    parse_payload,
)
from gateway.recording.window import Window
from gateway.records import Raw, Record, Stamp

AT_ONCE = 4096  # raw records
KEPT_PLACES = 100  # of the damaged places; the others are counted
SPENT_PER_BYTE = 16  # bytes of CRC for each byte passed over
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_NAME = struct.pack("<I", len(PROFILE)) + PROFILE.encode()
OPENING = MAGIC + RECORD_HEAD.pack(HEADER, 2 * len(_NAME)) + 2 * _NAME
_MESSAGES = rb"\x05.{3}\x00{5}.{6}(.{8})\1"  # a length of 24 bits, and two times that are the same
_ANYTHING = re.compile(_MESSAGES + rb"|\x04..\x00{6}|\x0c.{3}\x00{5}" + re.escape(_NAME), re.DOTALL)
_ONLY_MESSAGES = re.compile(_MESSAGES, re.DOTALL)
_LONGEST_SIGN = _MESSAGE.size  # of the patterns


class Implausible(DamagedRecord):
    """What cannot be a record, as cheap signs say."""


class Damage(NamedTuple):
    """A place of a file that holds no whole record."""

    path: Path
    offset: int
    length: int
    what: str


@dataclass
class Findings:
    """What reading found beside the records: places kept up to a bound, and all of them counted.

    `missing` are the records whose sequences no record has, `back` is how often sequences go back.
    """

    records: int = 0
    damaged: int = 0
    missing: int = 0
    back: int = 0
    places: list[Damage] = field(default_factory=list)
    torn: list[tuple[Path, str]] = field(default_factory=list)

    def add(self, place: Damage) -> None:
        """Count a damaged place."""
        self.damaged += 1
        if len(self.places) < KEPT_PLACES:
            self.places.append(place)


class IndexBegins(DamagedRecord):
    """The end of the data, where no sound index follows."""


class FileReader:
    """Reads one file from its beginning; `metadata` is known once the records begin."""

    def __init__(self, path: Path, window: Window, found: Findings) -> None:
        self.metadata: dict[str, str] = {}
        self.begins_as_ours = window.get(0, len(OPENING)) == OPENING
        self._path = path
        self._window = window
        self._found = found
        self._topics: dict[int, Topic] = {}
        self._listed: dict[int, Topic] | None = None  # by the index, once anybody has asked
        self._adapters: dict[int, str] = {}  # of raw channels
        self._seeds = np.zeros(CHANNELS, np.int64)
        self._columns = np.empty((COLUMNS, AT_ONCE), np.uint64)
        self._last: Stamp | None = None
        self._tail: int | None = None if window.closed else window.size  # where a torn end begins

    def records(self) -> Iterator[Record]:
        """Every whole record; damaged places and a torn end go to the findings."""
        return chain.from_iterable(self.runs())

    def runs(self) -> Iterator[Run]:
        """The same in runs, which cost no object for each record."""
        window, found = self._window, self._found
        before = found.records
        at = len(OPENING) if self.begins_as_ours else self._skip(0, DamagedRecord("no recording begins here"))
        loaded = False
        while at < window.end:
            if loaded:
                at = yield from self._raw_records(at)
            if at == window.end:
                break
            try:
                end, record = self._whole(at)
            except DamagedRecord as why:
                at = self._skip(at, why)
                continue
            at = end
            if record is not None:
                found.records += 1
                self._last = record.stamp
                loaded |= isinstance(record, Raw)  # who looks for one only shall not wait for the compiled loop
                yield (record,)
        if self._tail is not None:
            found.torn.append((self._path, self._torn(found.records - before, window.size - self._tail)))

    def _raw_records(self, at: int) -> Generator[Run, None, int]:
        """Raw records as long as they lie whole in the window one behind the other; where that ends."""
        data, base = self._window.data, self._window.base
        count, stopped = raw_records(np.frombuffer(data, np.uint8), at - base, self._seeds, self._columns)
        if not count:
            return at
        columns = self._columns[:, :count].copy()
        run = Chunks(columns, {number: self._adapters[number] for number in {*columns[NUMBER].tolist()}}, data)
        try:
            yield run
        finally:
            if given := run.given:
                self._found.records += given
                self._last = Stamp(*columns[[MONOTONIC_NS, UTC_NS], given - 1].tolist())
        return base + stopped

    def _whole(self, at: int) -> tuple[int, Record | None]:
        """The end of the MCAP record at an offset, and what it records. Raises DamagedRecord if it is not whole.

        The window is never asked for less than from that offset on, which may have to be looked at again.
        """
        window = self._window
        head = window.get(at, RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            raise Implausible("it is cut short")
        opcode, length = RECORD_HEAD.unpack(head)
        end = at + RECORD_HEAD.size + length
        if length >= LARGEST_RECORD or end > window.end:
            raise Implausible("the length of a record is wrong")
        if opcode == MESSAGE:
            return end, self._message(at, length)
        content = window.get(at, RECORD_HEAD.size + min(length, LARGEST_DESCRIPTION))[RECORD_HEAD.size :]
        if opcode == CHANNEL:
            self._know(*parse_channel(content))
        elif opcode == METADATA:
            self.metadata = parse_metadata(content)
        elif opcode == DATA_END and content == bytes(4):
            raise IndexBegins("the index is damaged")
        else:
            raise Implausible("no record begins here")
        return end, None

    def _message(self, at: int, length: int) -> Record:
        head = self._window.get(at, _MESSAGE.size)
        size = length + RECORD_HEAD.size - _MESSAGE.size
        if size < 0 or len(head) < _MESSAGE.size:
            raise Implausible("a message is too short")
        _, _, number, low, log_ns, published_ns = _MESSAGE.unpack(head)
        topic = self._topics.get(number) or self._from_index(number)
        if topic is None:
            raise Implausible(f"nothing says what channel {number} is")
        if log_ns != published_ns:
            raise Implausible("the times of a message differ")
        if topic.adapter is None:
            if size > LARGEST_DESCRIPTION:
                raise Implausible("a message is too long")
        elif (fields := self._window.get(at, RAW_BYTES))[-12:-4] != head[-8:] or fields[35:39] != head[11:15]:
            raise Implausible("the header of a raw chunk says another time or sequence than the chunk")
        record = parse_payload(topic, self._window.get(at, _MESSAGE.size + size)[_MESSAGE.size :])
        if (record.sequence & 0xFFFFFFFF, record.stamp.utc_ns) != (low, log_ns):
            raise DamagedRecord("the header of a message says another time or sequence than the message")
        return record

    def _know(self, number: int, topic: Topic) -> None:
        self._topics[number] = topic
        if topic.adapter is not None:
            self._adapters[number] = topic.adapter
            self._seeds[number] = KNOWN | topic.seed

    def _from_index(self, number: int) -> Topic | None:
        """A channel whose description in the data is lost."""
        if self._listed is None:
            self._listed = index.topics(self._window)
        if topic := self._listed.get(number):
            self._know(number, topic)
        return topic

    def _skip(self, at: int, why: DamagedRecord) -> int:
        """Where the next whole record begins behind a damaged place, which is told, or the end."""
        window, pattern = self._window, _ONLY_MESSAGES if isinstance(why, IndexBegins) else _ANYTHING
        budget, seen = LARGEST_RECORD, at
        begin = window.find(pattern, at + 1, _LONGEST_SIGN)
        while begin is not None:
            budget += SPENT_PER_BYTE * (begin - seen)
            seen = begin
            length = int.from_bytes(window.get(begin + 1, 3), "little")
            if length <= budget:
                try:
                    self._whole(begin)
                    break
                except Implausible:
                    pass
                except DamagedRecord:
                    budget -= length
            begin = window.find(pattern, begin + 1, _LONGEST_SIGN)
        end = window.end if begin is None else begin
        if begin is None and not window.closed and not (isinstance(why, IndexBegins) and window.ends_with_magic):
            self._tail = at
        else:
            self._tail = self._tail if begin else None
            self._found.add(Damage(self._path, at, end - at, str(why)))
        return end

    def _torn(self, records: int, spoilt: int) -> str:
        text = f"the file ends without its index after {records} records"
        if self._last:
            last = datetime.fromtimestamp(self._last.utc_ns / 1e9, UTC)
            text += f", the last one of {last:%Y-%m-%d %H:%M:%S.%f} UTC"
        return text + (f"; its last {spoilt} bytes are no whole record" if spoilt else "")
