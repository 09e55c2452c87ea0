"""RackLink 1 packets out of any byte stream: each byte received is framed, skipped or pending, and counted as such.

`Framer.feed` never raises on data. The body readers raise `MalformedBody` for a packet whose CRC is good and whose
body is not what its type says, so that the caller can count it; its bytes stay in the recording.
"""

import re
import struct
import zlib
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, ClassVar, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from cobs import cobs

from decoders import formats as f
from decoders.framing import HEADER, Packet, PacketFramer, Packets
from decoders.kernels_link import CRC_RESIDUE, described, entries, intact

__all__ = [
    "ChannelCount",
    "Framer",
    "Hello",
    "HelloChannel",
    "Joined",
    "MalformedBody",
    "Packet",
    "RadarWord",
    "TimedWords",
    "heartbeat",
    "hello",
    "joined429",
    "parsed",
    "radar_word",
    "time_mark",
    "words429",
]

VERSION: Final = f.LINK_VERSION
SHORTEST: Final = f.LINK_HEADER_BYTES + f.LINK_CRC_BYTES
LONGEST: Final = f.LINK_MAX_BYTES
PACKET_START: Final = re.compile(rb"(?=[\x03-\xff]\x01)")  # a COBS code that spans the version, 1, and a type
MOST_STARTS: Final = 256  # of a run; noise has 16 in 4 kB, and a hostile sender shall not keep us busy
COUNT: Final = struct.Struct(f.COUNTS)
ENTRY_429: Final = np.dtype([("offset_ns", "<u4"), ("word", "<u4")])
TIME_LIMIT_NS: Final = 2**63 - 2**32  # a device time above it, 292 years, would overflow once an offset is added


class MalformedBody(ValueError):
    """The body of an intact packet contradicts the packet's type."""


class TimedWords(NamedTuple):
    """All whole entries of an ARINC 429 packet: `time_ns` i8 (n,) device clock, `words` u4 (n,), bit 1 the LSB."""

    time_ns: npt.NDArray[np.int64]
    words: npt.NDArray[np.uint32]
    leftover_bytes: int  # after the last whole entry
    well_formed: bool  # 1 to 256 entries and nothing left over


class Joined(NamedTuple):
    """The ARINC 429 words of many packets, those of packets that run backwards left out.

    `time_ns` i8 (n,) device clock, `sent_ns` i8 (n,) the common one, `words` u4 (n,).
    """

    time_ns: npt.NDArray[np.int64]
    sent_ns: npt.NDArray[np.int64]
    words: npt.NDArray[np.uint32]
    malformed: int  # packets that are not 1 to 256 whole entries in order of time
    left_out: int  # words


class RadarWord(NamedTuple):
    """An ARINC 708 word as received: 1600 bits if it is a normal one. `data` has ceil(bit_count / 8) bytes."""

    bit_count: int
    data: bytes


class HelloChannel(NamedTuple):
    """One channel a bridge announces; codes as in `decoders.formats`, the equipment id is its low byte."""

    channel: int
    kind: int
    orientation: int
    equipment_id: int


class Hello(NamedTuple):
    """What a bridge is and has."""

    serial_number: int
    firmware: int
    channels: tuple[HelloChannel, ...]


class ChannelCount(NamedTuple):
    """Words a bridge has received on a channel, and words it has lost itself."""

    channel: int
    received: int
    lost: int


class Framer(PacketFramer):
    """Cuts a byte stream into packets; the outcome does not depend on how the stream is cut into pieces.

    Bytes: `received` = `framed` + `skipped` + `pending` after every call. `framed` counts intact packets with their
    closing 0x00, `skipped` all else that is finished with. Faults, once each: `bad_cobs`; `bad_crc`, also for a packet
    too short to hold a header and a CRC; `oversize`. `unknown_version` packets are intact and framed, but no Packet
    comes out, since nothing is known of their header. `pending` never exceeds the largest encoded packet.

    A packet that was cut short has lost its 0x00 too and runs into its neighbour; garbage does the same. So a faulty
    run is searched for a packet that ends it, and noise costs no more than itself.
    """

    NAMES: ClassVar = (*PacketFramer.NAMES, "bad_crc", "bad_cobs", "oversize", "unknown_version")

    def __init__(self) -> None:
        super().__init__()
        self.bad_crc = self.bad_cobs = self.oversize = self.unknown_version = 0
        self._run = bytearray()  # since the last 0x00, or its newest bytes if it is over-long
        self._overlong = False

    @property
    def pending(self) -> int:
        """Bytes kept for the next call."""
        return len(self._run)

    def feed(self, data: bytes) -> list[Packet]:
        """Packets completed by the next bytes of a stream (COBS, each closed by 0x00)."""
        decoded, found, _ = self._unstuff(data)
        if not len(found):
            return []
        whole, new = decoded.tobytes(), tuple.__new__
        return [new(Packet, _fields(size)(whole, begin)) for begin, size, _ in found.tolist()]

    def frame(self, data: npt.NDArray[np.uint8], ends: npt.NDArray[np.int64]) -> Packets:
        """Packets completed by the next chunks of a stream, which lie one behind the other and end at `ends`."""
        decoded, found, carried = self._unstuff(data.data)
        header, chunk = np.empty(len(found), HEADER), np.empty(len(found), np.int64)
        described(decoded, found, ends + carried, header.view(np.uint64).reshape(-1, 2), chunk)
        return Packets(header, found[:, 0] + f.LINK_HEADER_BYTES, found[:, 1] - SHORTEST, chunk, decoded)

    def _unstuff(self, new: bytes | memoryview) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64], int]:
        """A copy of the stream in which packets lie without COBS; of each (n, 3) start, size, and the place behind it.

        And how many bytes of earlier chunks come before these. A compiled loop takes intact runs, which nearly all are.
        """
        carried = bytes(self._run)
        stream = b"".join((carried, new))
        self.received += len(stream) - len(carried)
        at = len(carried) if self._overlong else 0
        if not self._overlong:
            self._run.clear()
        data, decoded = np.frombuffer(stream, np.uint8), np.frombuffer(bytearray(stream), np.uint8)
        found, count = np.empty((len(stream) // (SHORTEST + 2) + 1, 3), np.int64), 0
        while True:
            if not self._overlong:
                count, stopped = intact(data, at, decoded, found, count)
                self.framed += stopped - at
                at = stopped
            end = stream.find(0, at)
            if end < 0:
                break
            for packet in self._close(stream[at:end]):
                whole = np.frombuffer(struct.pack(f.LINK_HEADER, VERSION, *packet[:-1]) + packet.body, np.uint8)
                size = len(whole) + f.LINK_CRC_BYTES
                decoded[end - size : end - f.LINK_CRC_BYTES] = whole
                found[count] = end - size, size, end + 1
                count += 1
            at = end + 1
        self._extend(stream[at:])
        self._check_books()
        return decoded, found[:count], len(carried)

    def _extend(self, run: bytes) -> None:
        self._run += run
        excess = len(self._run) - f.LINK_MAX_ENCODED_BYTES
        if excess > 0:
            self.oversize += not self._overlong
            self._overlong = True
            self.skipped += excess
            del self._run[:excess]

    def _close(self, last: bytes) -> list[Packet]:
        """What comes of the run that ends with `last`: faults are told apart and searched here."""
        self._extend(last)
        run, overlong = bytes(self._run), self._overlong
        self._run.clear()
        self._overlong = False
        if not run:
            self.skipped += 1
            return []
        whole = None if overlong else _unstuffed(run)
        if isinstance(whole, Packet) or whole == "unknown_version":
            return self._account(whole, len(run) + 1)
        starts = [found.start() for found in PACKET_START.finditer(run, 0 if overlong else 1)]
        for start in reversed(starts[-MOST_STARTS:]):  # whatever was cut off before it, the good packet comes last
            packet = _unstuffed(run[start:])
            if isinstance(packet, Packet):
                self._account(whole, start)
                return self._account(packet, len(run) - start + 1)
        return self._account(whole, len(run) + 1)

    def _account(self, outcome: "Packet | Fault | None", size: int) -> list[Packet]:
        """Count `size` bytes and what became of them; None stands for a run whose fault is counted already."""
        if isinstance(outcome, Packet):
            self.framed += size
            return [outcome]
        if outcome == "unknown_version":
            self.framed += size
        else:
            self.skipped += size
        if outcome is not None:
            setattr(self, outcome, getattr(self, outcome) + 1)
        return []


Fault = Literal["bad_crc", "bad_cobs", "oversize", "unknown_version"]


def _unstuffed(run: bytes) -> Packet | Fault:
    """The packet of a run without its closing 0x00."""
    try:
        return parsed(cobs.decode(run))
    except cobs.DecodeError:
        return "bad_cobs"


def parsed(packet: bytes) -> Packet | Fault:
    """The packet of bytes without COBS, or what is wrong with them."""
    if len(packet) > LONGEST:
        return "oversize"
    if len(packet) < SHORTEST or zlib.crc32(packet) != CRC_RESIDUE:
        return "bad_crc"
    if packet[0] != VERSION:
        return "unknown_version"
    return Packet(*_fields(len(packet))(packet))


@cache  # at most one for each size that a packet can have
def _fields(size: int) -> Callable[..., tuple[Any, ...]]:
    """Reads all fields of a Packet, the body too, in one call from an intact packet of `size` bytes at a place."""
    without_version = f.LINK_HEADER.replace("B", "x", 1)
    return struct.Struct(f"{without_version}{size - SHORTEST}s{f.LINK_CRC_BYTES}x").unpack_from


def words429(packet: Packet) -> TimedWords:
    """The words of an ARINC 429 packet with their device times; a body of a wrong length gives its whole entries.

    Raises ValueError for another type of packet, MalformedBody for a device time beyond 292 years.
    """
    _require(packet, f.WORDS_429, "ARINC 429")
    if packet.time_ns > TIME_LIMIT_NS:
        raise MalformedBody(f"device time {packet.time_ns} ns does not fit a signed 64-bit count")
    count, leftover = divmod(len(packet.body), ENTRY_429.itemsize)
    pairs = np.frombuffer(packet.body, ENTRY_429, count)
    time_ns = pairs["offset_ns"] + np.int64(packet.time_ns)
    return TimedWords(time_ns, pairs["word"], leftover, leftover == 0 and 1 <= count <= f.LINK_MAX_WORDS)


def joined429(packet: Packet, offset_ns: int) -> Joined:
    """The words of an ARINC 429 packet of a device time within 292 years.

    The offset leads from device times to the common ones.
    """
    most = len(packet.body) // ENTRY_429.itemsize
    time_ns, sent_ns, words = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most, np.uint32)
    body = np.frombuffer(packet.body, np.uint8)
    count, malformed, left_out = entries(body, 0, len(body), packet.time_ns, offset_ns, time_ns, sent_ns, words, 0)
    return Joined(time_ns[:count], sent_ns[:count], words[:count], int(malformed), left_out)


def radar_word(packet: Packet) -> RadarWord:
    """The word of an ARINC 708 packet. Raises ValueError for another type, MalformedBody if bits and bytes disagree."""
    _require(packet, f.WORD_708, "ARINC 708")
    bit_count, data = int.from_bytes(packet.body[:2], "little"), packet.body[2:]
    if len(packet.body) < 2 or len(data) != (bit_count + 7) // 8:
        raise MalformedBody(f"{len(data)} bytes do not hold a radar word of {bit_count} bits")
    return RadarWord(bit_count, data)


def hello(packet: Packet) -> Hello:
    """What a bridge says of itself. Raises ValueError for another type, MalformedBody for a body cut short."""
    _require(packet, f.HELLO, "hello")
    return _hello(packet.body)


@lru_cache(maxsize=64)
def _hello(said: bytes) -> Hello:
    """The same again every few seconds, and it takes longer to read than all the words between."""
    body = _parse("HELLO", said)
    channels = tuple(HelloChannel(c.channel, c.kind, c.orientation, c.equipment_id) for c in body.channels)
    return Hello(body.serial_number, body.firmware, channels)


def heartbeat(packet: Packet) -> tuple[ChannelCount, ...]:
    """The counts of each channel. Raises ValueError for another type, MalformedBody for a body cut short."""
    _require(packet, f.HEARTBEAT, "heartbeat")
    if len(packet.body) % COUNT.size:
        raise MalformedBody(f"{len(packet.body)} bytes are no HEARTBEAT body")
    return tuple(ChannelCount(*count) for count in COUNT.iter_unpack(packet.body))


def time_mark(packet: Packet) -> int:
    """Device time, ns, of the latest time-mark edge. Raises ValueError for another type, MalformedBody if not a u64."""
    _require(packet, f.TIME_MARK, "time mark")
    return int(_parse("TIME_MARK", packet.body).edge_time_ns)


def _require(packet: Packet, kind: int, name: str) -> None:
    if packet.type != kind:
        raise ValueError(f"packet of type 0x{packet.type:02x} is no {name} packet (0x{kind:02x}): look at packet.type")


def _parse(layout: str, body: bytes) -> Any:
    # The layouts take construct with them, which only these rare packets need.
    from construct import ConstructError  # noqa: PLC0415

    from decoders import layouts  # noqa: PLC0415

    try:
        return getattr(layouts, layout).parse(body)
    except ConstructError as error:
        raise MalformedBody(f"{len(body)} bytes are no {layout} body") from error
