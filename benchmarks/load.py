"""What share of one core the pipeline takes from a rack at live rates. `make load`.

A radar of 200 words/s over real terrain and four ARINC 429 buses: first at the rates that the simulated instruments
have, then with every bus full. The bytes come as a quick serial line gives them, in a piece every 10 ms.
"""

import time
from collections.abc import Iterator
from typing import NamedTuple

from decoders import formats as f
from decoders.definitions import load_definitions
from decoders.racklink import Framer, Packet
from gateway.config import RackConfig, check_config
from gateway.events import IntegrityEvent
from gateway.metadata import build_monitor
from gateway.pipeline import Pipeline
from gateway.records import Raw, Stamp
from monitor.quantities import AXES, SOURCES
from simulators import arinc429, racklink
from simulators.link import whole_stream
from simulators.scenario import BUILT_IN_TERRAIN, Radar, Scenario, white_mountains

SECONDS = 30
PIECE_NS = 10_000_000
WORD_NS = f.WORD_429_BIT_TIMES * f.HIGH_SPEED_BIT_NS
BUSES = {1: "iru_704", 2: "gnss_743a", 3: "ra_707", 4: "adc_706"}
USED = {source.label for source in SOURCES} | {label for axis in AXES for label in (axis.coarse, axis.fine)}


class Load(NamedTuple):
    """A rack for so many seconds: its packets in order."""

    name: str
    packets: list[Packet]


class Spent(NamedTuple):
    """Where the time went, in s: of all pieces, and of those after which a verdict came."""

    total: float
    verdicts: float
    verdict_count: int


def main() -> None:
    """Feed both loads to the shipped pipeline and print what it takes."""
    flown = list(_flown())
    usual = Load("usual rates", sorted([*flown, *_filler(4, 1)], key=_begins))
    most = PIECE_NS // WORD_NS
    full = Load("all buses full", sorted([*flown, *(p for bus in BUSES for p in _filler(bus, most))], key=_begins))
    _spend(_pieces(usual.packets))  # compiles the kernels
    for load in (usual, full):
        _report(load)


def _report(load: Load) -> None:
    spent = _spend(_pieces(load.packets))
    framing = _spend_framing(_pieces(load.packets))
    words = sum(len(p.body) // 8 for p in load.packets if p.type == f.WORDS_429)
    radials = sum(p.type == f.WORD_708 for p in load.packets)
    print(f"{load.name}: {radials / SECONDS:.0f} radar words/s, {words / SECONDS:.0f} ARINC 429 words/s", end=", ")
    print(f"{len(load.packets) / SECONDS:.0f} packets/s")
    print(f"  one core: {100 * spent.total / SECONDS:.1f} %", end=", ")
    print(f"of it framing {100 * framing / SECONDS:.2f} %, verdicts {100 * spent.verdicts / SECONDS:.1f} %")
    print(f"  a verdict: {1e3 * spent.verdicts / max(spent.verdict_count, 1):.1f} ms")
    for name, kind in (("a radar word", f.WORD_708), ("a block of ARINC 429 words", f.WORDS_429)):
        chosen = [p for p in load.packets if p.type == kind]
        alone = _spend([_encoded(chosen[at : at + 10], at) for at in range(0, len(chosen), 10)], monitored=False)
        print(f"  {name}: {1e6 * alone.total / len(chosen):.0f} us")


def _scenario() -> Scenario:
    radar = Radar(antenna="rdr4b", step_deg=95.0 / 200)  # 95 deg/s
    return white_mountains(SECONDS).model_copy(update={"radar": radar, "gnss_interval_s": 0.1})


def _flown() -> Iterator[Packet]:
    yield from Framer().feed(whole_stream(_scenario()))


def _filler(channel: int, count: int) -> Iterator[Packet]:
    """A packet of `count` words every 10 ms, of labels that are decoded and used for nothing."""
    labels = sorted(load_definitions(BUSES[channel]).labels.keys() - USED) or [0o377]
    words = [int(arinc429.encode_data(labels[k % len(labels)], [0], ssm=3)[0]) for k in range(count)]
    body = racklink.words_429([k * WORD_NS for k in range(count)], words)
    for start in range(0, SECONDS * 1_000_000_000, PIECE_NS):
        yield Packet(f.WORDS_429, channel, 0, 0, start, body)


def _begins(packet: Packet) -> int:
    return packet.time_ns


def _encoded(packets: list[Packet], sequence: int) -> tuple[int, bytes]:
    coded = [racklink.encode(p.type, p.channel, sequence + k, p.time_ns, p.body) for k, p in enumerate(packets)]
    return packets[-1].time_ns, b"".join(coded)


def _pieces(packets: list[Packet]) -> list[tuple[int, bytes]]:
    """Time and bytes of each 10 ms, newly numbered."""
    gathered: dict[int, list[Packet]] = {}
    for packet in packets:
        gathered.setdefault(packet.time_ns // PIECE_NS, []).append(packet)
    pieces, sequence = [], 0
    for batch in gathered.values():
        pieces.append(_encoded(batch, sequence))
        sequence += len(batch)
    return pieces


def _spend(pieces: list[tuple[int, bytes]], monitored: bool = True) -> Spent:
    config = _rack(monitored)
    pipeline = Pipeline(config, build_monitor(config))
    total = verdicts = 0.0
    count = 0
    for number, (time_ns, data) in enumerate(pieces):
        raw = Raw(number, Stamp(time_ns, time_ns), "bridge", data)
        began = time.perf_counter()
        events = list(pipeline.feed(raw))
        took = time.perf_counter() - began
        total += took
        if any(isinstance(event, IntegrityEvent) for event in events):
            verdicts += took
            count += 1
    return Spent(total, verdicts, count)


def _spend_framing(pieces: list[tuple[int, bytes]]) -> float:
    framer = Framer()
    began = time.perf_counter()
    for _, data in pieces:
        framer.feed(data)
    return time.perf_counter() - began


def _rack(monitored: bool) -> RackConfig:
    channels: dict[int, dict[str, str]] = {0: {"kind": "arinc708"}}
    channels |= {number: {"kind": "arinc429", "definitions": name} for number, name in BUSES.items()}
    rack: dict[str, object] = {"adapters": [{"name": "bridge", "source": "serial:none", "channels": channels}]}
    if monitored:
        rack["terrain"] = [BUILT_IN_TERRAIN["white_mountains"]]
    return check_config(rack, "load")


if __name__ == "__main__":
    main()
