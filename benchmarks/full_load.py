"""A rack at the full rate of its buses, over each kind of line: what is lost, and what it costs. `make full-load`.

A radar that sends without a pause and four ARINC 429 buses without a gap. The gateway records, decodes, judges each
scan against real terrain and prints its events to a file. It shares a process with the simulated bridge, whose own
thread is not counted but makes it wait, as Python runs one of them at a time.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from decoders import formats as f
from decoders.definitions import load_definitions
from gateway.adapters import usb as usb_adapter
from gateway.config import RackConfig, check_config
from gateway.events import Event, ScanEvent, SummaryEvent
from gateway.metadata import build_monitor
from gateway.service import Service
from monitor.quantities import AXES, SOURCES
from simulators import arinc429, bridge, carriers, racklink
from simulators.ledger import Ledger
from simulators.outlets import PtyOutlet, UdpOutlet
from simulators.outlets.canbus import CanOutlet
from simulators.outlets.usb import UsbBackend, UsbDevice
from simulators.player import Played, play
from simulators.scenario import BUILT_IN_TERRAIN, white_mountains
from simulators.schedule import BATCH_NS, Due
from simulators.traffic import traffic

BUSES = {1: "gnss_743a", 2: "iru_704", 3: "ra_707", 4: "adc_706"}
KINDS = {0: (f.KIND_708, 0)} | {n: (f.KIND_429_HIGH, load_definitions(name).equipment_id) for n, name in BUSES.items()}
USED = {source.label for source in SOURCES} | {label for axis in AXES for label in (axis.coarse, axis.fine)}
WORD_NS = f.WORD_429_BIT_TIMES * f.HIGH_SPEED_BIT_NS
RADIAL_NS = 1000 * f.WORD_708_US
SWEEP = 361  # radials
SETTLED_S = 2.0  # of sending, until costs are counted
LAST_WORDS_S = 1.0
UDP_PORT = 47_001
MIB = 1 << 20


class Line(NamedTuple):
    """A kind of line: its outlet, how packets go down it, and the gateway's name for it."""

    outlet: Callable[[], Any]
    carrier: Callable[[], carriers.Carrier[Any]]
    source: str = ""


LINES = {
    "serial": Line(PtyOutlet, carriers.stream),
    "usb": Line(UsbDevice, carriers.stream, "usb:1209:7080"),
    "can": Line(lambda: CanOutlet("virtual", "load", fd=True), partial(carriers.can, fd=True)),
    "udp": Line(lambda: UdpOutlet("127.0.0.1", UDP_PORT), carriers.datagram),
}


class Costs(NamedTuple):
    """What the process has used at a moment: its own time without the sender's, in s, and memory in bytes."""

    time_s: float
    cpu_s: float
    memory: int


class Sent(NamedTuple):
    """A packet as it goes down the line."""

    ready_ns: int
    type: int
    units: Sequence[Any]


@dataclass
class Sender:
    """Plays the load, and notes when each scan was complete and what the gateway has used."""

    seconds: float
    ledger: Ledger = field(default_factory=Ledger)
    scan_ended_s: list[float] = field(default_factory=list)
    costs: list[Costs] = field(default_factory=list)
    played: Played = field(default_factory=Played)

    def prepare(self, carrier: carriers.Carrier[Any]) -> list[Sent]:
        """All that goes down the line, made beforehand: making it would take the gateway's time."""
        packets = bridge.Bridge(KINDS, self.ledger).packets(_dues(self.seconds))
        return [Sent(ready_ns, packet.type, carrier.units(packet)) for ready_ns, packet in packets]

    def play(self, prepared: list[Sent], outlet: Any) -> None:
        """The work of the sender's thread."""
        self.played = play(self._units(prepared), outlet)

    def _units(self, prepared: list[Sent]) -> Iterator[tuple[int, Any]]:
        radials = 0
        for ready_ns, kind, units in prepared:
            for unit in units:
                yield ready_ns, unit
            if kind == f.WORD_708:
                radials += 1
                if radials % SWEEP == 1 and radials > 1:  # the first of a sweep ends the one before
                    self.scan_ended_s.append(time.monotonic())
            elif kind == f.HEARTBEAT and ready_ns > SETTLED_S * 1e9:
                self.costs.append(Costs(time.monotonic(), time.process_time() - time.thread_time(), memory()))


def run(name: str, seconds: float) -> dict[str, float]:
    """Send the load for so many seconds; what became of it."""
    line = LINES[name]
    events: list[tuple[float, Event]] = []
    sender = Sender(seconds)
    prepared = sender.prepare(line.carrier())
    with (
        tempfile.TemporaryDirectory() as directory,
        line.outlet() as outlet,
        patch.object(usb_adapter, "get_backend", lambda: UsbBackend([outlet])),
    ):
        config = _rack(line.source or outlet.place, Path(directory))
        with (Path(directory) / "events.jsonl").open("w") as log:

            def emit(event: Event) -> None:
                log.write(event.to_json() + "\n")
                events.append((time.monotonic(), event))

            service = Service(config, build_monitor(config), emit)
            service.start()
            thread = threading.Thread(target=sender.play, args=(prepared, outlet))
            thread.start()
            thread.join()
            time.sleep(LAST_WORDS_S)
            service.stop()
    return _results(sender, events)


def _results(sender: Sender, events: list[tuple[float, Event]]) -> dict[str, float]:
    counters = next(event.counters for _, event in events if isinstance(event, SummaryEvent))
    scans_s = [time_s for time_s, event in events if isinstance(event, ScanEvent)]
    waits_ms = [1e3 * (seen - ended) for seen, ended in zip(scans_s, sender.scan_ended_s, strict=False)]
    p50, p99, worst = np.percentile(waits_ms, [50, 99, 100])
    first, last = sender.costs[0], sender.costs[-1]
    sent_708, sent_429 = (
        sum(count for (_, kind), count in sender.ledger.carried.items() if kind == wanted)
        for wanted in (f.WORD_708, f.WORDS_429)
    )
    return {
        "radar words sent": sent_708,
        "radar words arrived": counters["bridge.words_708"],
        "ARINC 429 words sent": sent_429,
        "ARINC 429 words arrived": counters["bridge.words_429"],
        "words counted as lost": counters["bridge.words_lost_on_link"] + counters["bridge.words_lost_in_bridge"],
        "share of one core (%)": 100 * (last.cpu_s - first.cpu_s) / (last.time_s - first.time_s),
        "growth of memory (MiB)": (last.memory - first.memory) / MIB,
        "last byte of a radial to its scan's event, p50 (ms)": p50,
        "p99 (ms)": p99,
        "max (ms)": worst,
        "sender late at worst (ms)": 1e3 * sender.played.worst_lateness_s,
    }


def _dues(seconds: float) -> Iterator[Due]:
    """What the bridge sends: instruments of a flight, words that fill their buses, and one sweep again and again."""
    flight = white_mountains(seconds)
    words = [packet.body for _, packet in traffic(white_mountains(5.0)) if packet.type == f.WORD_708][:SWEEP]
    flown = (pair for pair in traffic(flight) if pair[1].type == f.WORDS_429)
    ahead = next(flown, None)
    total_ns, radials = round(seconds * 1e9), 0
    for start in range(0, total_ns, BATCH_NS):
        end = start + BATCH_NS
        dues = list(bridge.routine(start, end))
        room = dict.fromkeys(BUSES, end // WORD_NS - start // WORD_NS)
        while ahead and ahead[0] < end:
            ready_ns, packet = ahead
            dues.append(Due(ready_ns, packet.channel, packet.type, packet.time_ns, packet.body, packet.words))
            room[packet.channel] -= packet.words
            ahead = next(flown, None)
        dues += [_filler(bus, count, start, end) for bus, count in room.items() if count > 0]
        while (radials + 1) * RADIAL_NS <= end:
            begun = radials * RADIAL_NS
            dues.append(Due(begun + RADIAL_NS, 0, f.WORD_708, begun, words[radials % SWEEP], 1))
            radials += 1
        yield from sorted(dues)
    yield bridge.heartbeat(total_ns)


def _filler(bus: int, count: int, start_ns: int, end_ns: int) -> Due:
    """Words of labels that are decoded and used for nothing."""
    labels = sorted(load_definitions(BUSES[bus]).labels.keys() - USED)
    words = [int(arinc429.encode_data(labels[k % len(labels)], [0], ssm=3)[0]) for k in range(count)]
    body = racklink.words_429([k * WORD_NS for k in range(count)], words)
    return Due(end_ns, bus, f.WORDS_429, start_ns, body, count)


def _rack(source: str, directory: Path) -> RackConfig:
    channels: dict[int, dict[str, str]] = {0: {"kind": "arinc708"}}
    channels |= {number: {"kind": "arinc429", "definitions": name} for number, name in BUSES.items()}
    return check_config(
        {
            "adapters": [{"name": "bridge", "source": source, "channels": channels}],
            "terrain": [BUILT_IN_TERRAIN["white_mountains"]],
            "recording": {"directory": directory},
        },
        "full load",
    )


def memory() -> int:
    """Bytes that this process holds."""
    resident = Path("/proc/self/status").read_text().partition("VmRSS:")[2].split()[0]
    return 1024 * int(resident)


def main() -> None:
    """Each kind of line in a process of its own, as memory is to be seen from the start."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lines", nargs="*", default=list(LINES), help="kinds of line: all of them if left")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--here", action="store_true", help="in this process, printed as JSON")
    options = parser.parse_args()
    for name in options.lines:
        if options.here:
            print(json.dumps(run(name, options.seconds)))
            continue
        command = [sys.executable, "-m", "benchmarks.full_load", name, "--here", "--seconds", str(options.seconds)]
        said = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603 # our own command
        print(f"{name}, {options.seconds:.0f} s")
        for what, figure in json.loads(said.stdout).items():
            print(f"  {what:52} {figure:10.1f}" if isinstance(figure, float) else f"  {what:52} {figure:8d}")


if __name__ == "__main__":
    main()
