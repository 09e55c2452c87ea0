"""A bridge on three buses for a few seconds, quick to make: what it sends, and what a host makes of what comes."""

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

from cobs import cobs

from simulators import bridge, carriers, racklink
from simulators.bridge import Bridge
from simulators.carriers import Carrier, Frame, Name, Unit
from simulators.faults import device, link, through
from simulators.ledger import Ledger
from simulators.scenario import LinkFault
from simulators.schedule import Due

KINDS = {0: (0x70, 0), 1: (0x2A, 4), 2: (0x2A, 11)}
WORD = 0x600C808B  # odd parity, label 321 octal
SECONDS = 3
SECOND_NS = 10**9
CARRIERS: dict[Name, Callable[[], Carrier[bytes] | Carrier[Frame]]] = {
    "stream": carriers.stream,
    "datagram": carriers.datagram,
    "can": carriers.can,
    "slcan": carriers.slcan,
}


@cache
def dues() -> tuple[Due, ...]:
    """Five words every 10 ms on channel 1, two every 50 ms on channel 2, a radar word every 20 ms; a last heartbeat."""
    listed = list(bridge.routine(0, SECONDS * SECOND_NS))
    for number in range(100 * SECONDS):
        ready_ns = (number + 1) * 10_000_000 - 1
        listed.append(words(ready_ns, 1, 5))
        if number % 5 == 0:
            listed.append(words(ready_ns, 2, 2))
        if number % 2 == 0:
            body = racklink.word_708(struct.pack("<I", number) * 50)
            listed.append(Due(ready_ns, 0, 0x20, ready_ns - 1_606_000, body, 1))
    return (*sorted(listed), bridge.heartbeat(SECONDS * SECOND_NS))


def words(ready_ns: int, channel: int, count: int) -> Due:
    offsets = [360_000 * k for k in range(count)]
    return Due(ready_ns, channel, 0x10, ready_ns - 9_000_000, racklink.words_429(offsets, [WORD] * count), count)


def packets(faults: Sequence[LinkFault] = (), ledger: Ledger | None = None, seed: int = 1) -> list[racklink.Packet]:
    """What the bridge sends under the faults of the device."""
    return [packet for _, packet in timed_packets(faults, ledger, seed)]


def timed_packets(
    faults: Sequence[LinkFault] = (), ledger: Ledger | None = None, seed: int = 1
) -> Iterator[tuple[int, racklink.Packet]]:
    due = through(iter(dues()), faults, device.FAULTS, seed)
    return Bridge(KINDS, Ledger() if ledger is None else ledger).packets(due)


def sent(
    carrier: Carrier[Unit], faults: Sequence[LinkFault] = (), ledger: Ledger | None = None, seed: int = 1
) -> list[tuple[int, Unit]]:
    """What goes down the line under the faults of device and link."""
    units = ((ready, unit) for ready, packet in timed_packets(faults, ledger, seed) for unit in carrier.units(packet))
    return list(through(units, faults, link.FAULTS[carrier.name], seed))


class Heard(NamedTuple):
    """Words by channel, and the last counts of the heartbeats: words received and words lost by channel."""

    words: Counter[int]
    counts: dict[int, tuple[int, int]]


def heard(units: Iterable[bytes | Frame], name: Name) -> Heard:
    """What a host makes of it that believes nothing without a CRC, but a CAN frame."""
    found = Heard(Counter(), {})
    if name == "can":
        for unit in units:
            assert isinstance(unit, Frame)
            _take_frame(unit, found)
        return found
    data = [unit for unit in units if isinstance(unit, bytes)]
    for packet in data if name == "datagram" else b"".join(data).split(b"\0"):
        _take_packet(packet if name == "datagram" else _decoded(packet), found)
    return found


def _take_frame(frame: Frame, found: Heard) -> None:
    prefix, channel, kind = frame.id >> 24, frame.id >> 16 & 0xFF, frame.id >> 12 & 0xF
    assert prefix == 0b10110
    if kind == 2:
        received, lost = struct.unpack("<II", frame.data)
        found.counts[channel] = (received, lost)
    else:
        found.words[channel] += kind == 0 or frame.id & 0xFFF == 0  # a radar word for its first segment


def _take_packet(packet: bytes, found: Heard) -> None:
    if len(packet) < 20 or struct.pack("<I", zlib.crc32(packet[:-4])) != packet[-4:]:
        return
    kind, channel, body = packet[1], packet[2], packet[16:-4]
    if kind == 0x02:
        found.counts.update({number: (got, lost) for number, got, lost in struct.iter_unpack("<BII", body)})
    found.words[channel] += {0x10: len(body) // 8, 0x20: 1}.get(kind, 0)


def _decoded(run: bytes) -> bytes:
    try:
        return bytes(cobs.decode(run))
    except cobs.DecodeError:
        return b""
