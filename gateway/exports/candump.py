"""The log of `candump -L`, which can-utils replays: frames of CAN adapters as they came, other words as RackLink's.

Each adapter is an interface of its own, can0 and so on in the order of the configuration.
"""

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from decoders import formats as f
from decoders.can_frames import FrameReader, Slcan, Socketcand, split
from decoders.racklink_can import CanFramer
from gateway.config import AdapterConfig
from gateway.exports import Job
from gateway.framing import form_of
from gateway.link import SPOILT
from gateway.records import Raw
from gateway.words import Block429, Item, Word708, WordStage

WORD = struct.Struct(f.CAN_429)
HEAD_708 = struct.Struct(f.CAN_708_HEAD)
SEGMENT = f.CAN_SEGMENT_BYTES["fd"]
CLASSIC_BYTES = 8
FD_FLAGS, FD_FRAME = 0xF, 0x4  # SocketCAN's flags as the log has them, and the one that a frame is FD
FULL_11_BITS, FULL_29_BITS = 0x7FF, 0x1FFF_FFFF
TEXTS: dict[str, type[Slcan] | type[Socketcand]] = {"slcan": Slcan, "socketcand": Socketcand}


def line(utc_ns: int, interface: str, identifier: int, data: bytes, flags: int = 0) -> str:
    """A frame as a line of the log; identifier and FD flags as SocketCAN's."""
    seconds, rest_ns = divmod(utc_ns, 1_000_000_000)
    if identifier & f.CAN_ERROR:
        name = f"{identifier & (f.CAN_ERROR | FULL_29_BITS):08X}"
    elif identifier & f.CAN_EXTENDED:
        name = f"{identifier & FULL_29_BITS:08X}"
    else:
        name = f"{identifier & FULL_11_BITS:03X}"
    if identifier & f.CAN_REMOTE:
        content = "#R"
    elif flags & FD_FRAME or len(data) > CLASSIC_BYTES:
        content = f"##{flags & FD_FLAGS:X}{data.hex().upper()}"
    else:
        content = f"#{data.hex().upper()}"
    return f"({seconds}.{rest_ns // 1000:06d}) {interface} {name}{content}\n"


def export(job: Job, path: Path) -> str:
    """Write the log in the order of the recording."""
    log = _Log(job)
    with path.open("x", encoding="ascii") as file:
        for record in job.records():
            if isinstance(record, Raw) and record.adapter in log.interfaces:
                file.writelines(log.lines(record))
    job.left_out |= log.left_out()
    names = ", ".join(f"{interface} is {name}" for name, interface in log.interfaces.items())
    return f"{log.frames} frames; {names}"


class _Log:
    def __init__(self, job: Job) -> None:
        self.frames = 0
        self.interfaces = {adapter.name: f"can{k}" for k, adapter in enumerate(job.config.adapters)}
        self._can = {a.name: _reader_of(a) for a in job.config.adapters if isinstance(form_of(a).framer(), CanFramer)}
        self._stage = WordStage(job.config)
        self._radar_words: Counter[tuple[str, int]] = Counter()
        self._spoilt = 0

    def lines(self, record: Raw) -> Iterator[str]:
        """The lines of a record."""
        if record.adapter in self._can:
            found = self._as_they_came(record)
        else:
            found = (text for item in self._stage.feed(record) for text in self._words(item))
        for text in found:
            self.frames += 1
            yield text

    def left_out(self) -> dict[str, int]:
        """What is not in the log, by what it is."""
        of_text = {
            f"lines of {name} ({what.replace('_', ' ')})": count
            for name, reader in self._can.items()
            if reader
            for what, count in reader.counters.items()
        }
        return self._stage.left_out() | of_text | {"ARINC 429 words whose bits cannot be trusted": self._spoilt}

    def _as_they_came(self, record: Raw) -> Iterator[str]:
        interface, reader = self.interfaces[record.adapter], self._can[record.adapter]
        if reader:
            for frame in reader.feed(record.data):
                yield line(record.stamp.utc_ns, interface, frame.identifier | f.CAN_EXTENDED, frame.data)
            return
        ahead_ns = record.stamp.utc_ns - record.stamp.monotonic_ns
        for arrival_ns, identifier, flags, data in split(record.data):
            yield line(max(arrival_ns + ahead_ns, 0), interface, identifier, data, flags)

    def _words(self, item: Item) -> Iterator[str]:
        """The frames of words, by the table of RackLink over CAN."""
        interface = self.interfaces[item.adapter]
        base = f.CAN_EXTENDED | f.CAN_PREFIX << 24 | item.channel << 16
        if isinstance(item, Block429):
            if item.flags & SPOILT:  # such a frame has no flags to say it
                self._spoilt += len(item.words)
                return
            low_us = item.device_ns // 1000 % (1 << 32)
            for word, us, utc_ns in zip(item.words.tolist(), low_us.tolist(), item.utc_ns.tolist(), strict=True):
                yield line(utc_ns, interface, base | f.CAN_WORD_429 << 12 | word & 0xFF, WORD.pack(word, us))
        elif isinstance(item, Word708):
            here = item.adapter, item.channel
            counter = bytes([self._radar_words[here] % 256])
            self._radar_words[here] += 1
            content = HEAD_708.pack(item.device_ns, item.bit_count, item.flags) + item.data
            for index, start in enumerate(range(0, len(content), SEGMENT)):
                data = _padded(counter + content[start : start + SEGMENT])
                yield line(item.utc_ns, interface, base | f.CAN_WORD_708 << 12 | index, data, FD_FRAME)


def _reader_of(adapter: AdapterConfig) -> FrameReader | None:
    """What reads the text of an adapter; None if it records a driver's frames."""
    text = TEXTS.get(adapter.source.split(":")[1])
    return text() if text else None


def _padded(data: bytes) -> bytes:
    """With zeros up to the next length that an FD frame can have."""
    length = next(length for length in f.CAN_FD_LENGTHS if length >= len(data))
    return data.ljust(length, b"\0")
