"""Records and packets made by hand, with times that a reader can follow."""

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from decoders import formats as f
from gateway.config import check_config
from gateway.events import Event, SummaryEvent
from gateway.pipeline import Pipeline
from gateway.records import Note, Raw, Record, Stamp, Status, Tick
from simulators import arinc429, arinc708, racklink

E = TypeVar("E", bound=Event)

UTC_NS = 1_780_000_000_000_000_000
SECOND_NS = 1_000_000_000
RADAR, GNSS, IRU = 0, 1, 2  # channels
BINS = np.arange(512) // 16 % 2
RACK = check_config({"adapters": [{"name": "bridge", "source": "serial:x"}]}, "test")

HELLO = racklink.hello(
    7, 0x0100, [(RADAR, f.KIND_708, 0, 0), (GNSS, f.KIND_429_LOW, 0, 0x0B), (IRU, f.KIND_429_HIGH, 0, 4)]
)


def stamp(time_s: float) -> Stamp:
    """Both clocks, `time_s` after the start."""
    return Stamp(round(time_s * SECOND_NS), UTC_NS + round(time_s * SECOND_NS))


def raw(sequence: int, time_s: float, data: bytes, dropped: int = 0, adapter: str = "bridge") -> Raw:
    return Raw(sequence, stamp(time_s), adapter, data, dropped)


def status(sequence: int, time_s: float, state: str, reason: str = "", adapter: str = "bridge") -> Status:
    return Status(sequence, stamp(time_s), adapter, state, reason)


def tick(sequence: int, time_s: float) -> Tick:
    return Tick(sequence, stamp(time_s))


def some_records() -> list[Record]:
    """One of each kind, and every byte value."""
    return [
        status(0, 0.0, "UP", "first \u2014 with a dash"),
        raw(1, 0.1, bytes(range(256)), dropped=3),
        Note(2, stamp(0.2), "UTC of the host stepped"),
        tick(3, 1.0),
        raw(4, 1.1, b""),
        raw(5, 1.2, b"other", adapter="left-2"),
    ]


class Bridge:
    """Encodes packets with a running sequence; device time is given in seconds."""

    def __init__(self, sequence: int = 0) -> None:
        self.sequence = sequence

    def packet(self, kind: int, channel: int, time_s: float, body: bytes, flags: int = 0) -> bytes:
        encoded = racklink.encode(kind, channel, self.sequence, round(time_s * SECOND_NS), body, flags=flags)
        self.sequence += 1
        return encoded

    def hello(self, time_s: float = 0.0, body: bytes = HELLO) -> bytes:
        return self.packet(f.HELLO, 0, time_s, body)

    def heartbeat(self, time_s: float) -> bytes:
        return self.packet(f.HEARTBEAT, 0, time_s, racklink.heartbeat([(GNSS, 1, 0)]))

    def words(self, channel: int, time_s: float, words: Iterable[int], flags: int = 0) -> bytes:
        listed = list(words)
        return self.packet(f.WORDS_429, channel, time_s, racklink.words_429([0] * len(listed), listed), flags)

    def radar(self, time_s: float, word: bytes, flags: int = 0) -> bytes:
        return self.packet(f.WORD_708, RADAR, time_s, racklink.word_708(word), flags)


def feed(pipeline: Pipeline, *records: Record) -> list[Event]:
    return [event for record in records for event in pipeline.feed(record)]


def only(kind: type[E], events: Iterable[Event]) -> list[E]:
    return [event for event in events if isinstance(event, kind)]


def counters(pipeline: Pipeline) -> dict[str, int]:
    (summary,) = only(SummaryEvent, pipeline.finish())
    return summary.counters


def position(latitude: float = 44.4, longitude: float = -71.7, ssm: int = 3) -> list[int]:
    words = []
    for coarse, fine, degrees in ((0o110, 0o120, latitude), (0o111, 0o121, longitude)):
        words += [int(word[0]) for word in arinc429.encode_position(coarse, fine, [degrees], ssm=ssm)]
    return words


def radial(angle_deg: float) -> bytes:
    return arinc708.encode(BINS, scan_angle_deg=angle_deg, tilt_deg=-2.0, range_nm=10.0)


def sweep(bridge: Bridge, start_s: float, turn: bool = True) -> bytes:
    """Ten radials to the right, and one back at the left that ends the sweep."""
    angles = [*range(-15, 15, 3), *([-15] if turn else [])]
    return b"".join(bridge.radar(start_s + 0.05 * k, radial(angle)) for k, angle in enumerate(angles))
