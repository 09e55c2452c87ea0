"""Recordings to export, and what was sent in them, read by the simulators' own code."""

import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from decoders import formats as f
from gateway.config import RackConfig, check_config
from gateway.metadata import build_monitor, describe
from gateway.recording import Recorder
from gateway.records import Raw, Record, Stamp
from simulators import racklink
from simulators.scenario import BUILT_IN_TERRAIN, Scenario

UTC_NS = 1_780_000_000_000_000_000
BOOT_NS = 77_000_000_000  # the host had been up so long when the bridge's clock began
TERRAIN = BUILT_IN_TERRAIN["white_mountains"]
To = Callable[..., tuple[Path, list[str]]]


class Sent(NamedTuple):
    """A word as it was sent; a radar word has its bytes."""

    channel: int
    time_ns: int
    word: int | bytes


class Flown(NamedTuple):
    """A recording of a flight, what was sent, and the smallest delay: UTC of reading minus the bridge's time."""

    path: Path
    scenario: Scenario
    words: list[Sent]
    radar: list[Sent]
    least_delay_ns: int

    def of(self, channel: int) -> list[Sent]:
        """The ARINC 429 words of a channel."""
        return [sent for sent in self.words if sent.channel == channel]


def record(path: Path, config: RackConfig, records: Iterable[Record]) -> Path:
    """A recording of these records."""
    recorder = Recorder(path, describe(config, build_monitor(config)))
    recorder.append([*records])
    recorder.close()
    return path


def fly(path: Path, scenario: Scenario, flight: list[tuple[int, bytes]]) -> Flown:
    """Record a flight whose packets are read 1 to 4 ms after they were ready."""
    config = check_config({"adapters": [{"name": "bridge", "source": "serial:none"}], "terrain": [TERRAIN]}, "test")
    delays_ns = np.random.default_rng(3).integers(1_000_000, 4_000_000, len(flight)).tolist()
    records: list[Raw] = []
    words: list[Sent] = []
    radar: list[Sent] = []
    delays: list[int] = []
    for k, ((ready_ns, data), delay_ns) in enumerate(zip(flight, delays_ns, strict=True)):
        stamp = Stamp(BOOT_NS + ready_ns + delay_ns, UTC_NS + ready_ns + delay_ns)
        records.append(Raw(k, stamp, "bridge", data))
        packet = racklink.unpacked(racklink.unframed(data))
        if packet.type == f.WORDS_429:
            words += [
                Sent(packet.channel, packet.time_ns + offset_ns, word)
                for offset_ns, word in struct.iter_unpack("<II", packet.body)
            ]
        elif packet.type == f.WORD_708:
            radar.append(Sent(packet.channel, packet.time_ns, packet.body[2:]))
        if packet.type in (f.WORDS_429, f.WORD_708):
            delays.append(stamp.utc_ns - packet.time_ns)
    return Flown(record(path, config, records), scenario, words, radar, min(delays))
