"""Fifteen minutes of trouble on every kind of line at once. `make soak`.

Four bridges speak to one gateway, and every few seconds each has another fault, one of those that its line can have.
Prints what the process holds as time passes, and fails if memory or open files grow, if an event comes later and later,
or if at the end a single word has neither arrived nor been counted as lost.
"""

import argparse
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.full_load import KINDS, LINES, memory
from decoders import formats as f
from gateway.adapters import usb as usb_adapter
from gateway.config import check_config
from gateway.events import Event, SummaryEvent
from gateway.metadata import build_monitor
from gateway.service import Service
from simulators import arinc429, arinc708, bridge, carriers, racklink
from simulators.faults import device, link, plug, through
from simulators.ledger import Ledger
from simulators.outlets import PtyOutlet
from simulators.outlets.usb import UsbBackend
from simulators.player import play
from simulators.scenario import BUILT_IN_TERRAIN, LinkFault
from simulators.schedule import BATCH_NS, Due

FAULT_EVERY_S, FAULT_LASTS_S = 5.0, 1.0
CALM_S = 5.0  # at the end, so that the last heartbeats put the books right
SAMPLE_S = 15.0
RADAR_NS = 12_500_000  # 80 radar words a second
WORDS = 5  # of a packet, one every 10 ms on each ARINC 429 bus
GROWTH_MIB, GROWTH_FILES, LATEST_S = 24, 8, 1.0
MIB = 1 << 20
ANGLES = range(-90, 91)
WHERE = ("", "_lost_on_link", "_lost_in_bridge")
CHANNELS = {
    0: {"kind": "arinc708"},
    1: {"kind": "arinc429", "definitions": "gnss_743a"},
    2: {"kind": "arinc429", "definitions": "iru_704"},
    3: {"kind": "arinc429", "definitions": "ra_707"},
    4: {"kind": "arinc429", "definitions": "adc_706"},
}


class Sample(NamedTuple):
    """What the process holds, and how late the latest event since the sample before was, in s."""

    after_s: float
    memory_mib: float
    files: int
    threads: int
    latest_s: float


@dataclass
class Speaker:
    """A bridge on one line, with faults for so long."""

    name: str
    outlet: Any
    source: str
    carrier: Callable[[], carriers.Carrier[Any]]
    faults: list[LinkFault]
    seconds: float
    ledger: Ledger = field(default_factory=Ledger)

    def speak(self) -> None:
        """The work of the bridge's thread."""
        carrier = self.carrier()
        dues = through(_dues(self.seconds), self.faults, device.FAULTS, seed=1)
        packets = bridge.Bridge(KINDS, self.ledger).packets(dues)
        carried = ((ready_ns, unit) for ready_ns, packet in packets for unit in carrier.units(packet))
        units = through(carried, self.faults, link.FAULTS[carrier.name], seed=2)
        play(through(units, self.faults, plug.FAULTS, seed=3), self.outlet)


def main() -> None:
    """Run, print, and exit with 1 if anything grew or was lost without being counted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=900.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as directory:
        speakers = list(_speakers(Path(directory), seconds))
        usb = next(speaker.outlet for speaker in speakers if speaker.name == "usb")
        with patch.object(usb_adapter, "get_backend", lambda: UsbBackend([usb])):
            samples, counters = _run(speakers, Path(directory))
        for speaker in speakers:
            speaker.outlet.close()
    troubles = [*_growth(samples), *_uncounted(speakers, counters)]
    print("\n".join(troubles) or "nothing grew, and every word has arrived or is counted as lost")
    sys.exit(bool(troubles))


def _run(speakers: list[Speaker], directory: Path) -> tuple[list[Sample], dict[str, int]]:
    adapters = [{"name": s.name, "source": s.source, "channels": CHANNELS} for s in speakers]
    terrain = [BUILT_IN_TERRAIN["white_mountains"]]
    config = check_config({"adapters": adapters, "terrain": terrain, "recording": {"directory": directory}}, "soak")
    latest_s, summaries, kinds = [0.0], [], Counter[str]()

    def emit(event: Event) -> None:
        latest_s[0] = max(latest_s[0], time.time() - event.time_ns / 1e9)
        kinds[event.type] += 1
        if isinstance(event, SummaryEvent):
            summaries.append(event.counters)

    service = Service(config, build_monitor(config), emit)
    service.start()
    threads = [threading.Thread(target=speaker.speak) for speaker in speakers]
    for thread in threads:
        thread.start()
    samples, began_s = [], time.monotonic()
    while any(thread.is_alive() for thread in threads):
        time.sleep(min(SAMPLE_S, speakers[0].seconds / 10))
        samples.append(_sample(time.monotonic() - began_s, latest_s[0]))
        latest_s[0] = 0.0
        print(_line(samples[-1]), flush=True)
    time.sleep(CALM_S)
    service.stop()
    print(f"events: {dict(kinds)}; failures: {service.failures or 'none'}")
    return samples, summaries[0]


def _speakers(directory: Path, seconds: float) -> Iterator[Speaker]:
    rng = np.random.default_rng(7)
    for name, line in LINES.items():
        outlet = PtyOutlet(directory / "tty") if name == "serial" else line.outlet()
        plugs = plug.FAULTS if name in {"serial", "usb"} else {}
        possible = {*device.FAULTS, *link.FAULTS[line.carrier().name], *plugs}
        starts = np.arange(FAULT_EVERY_S, seconds - CALM_S, FAULT_EVERY_S)
        drawn = rng.choice(sorted(possible), len(starts))
        faults = [
            LinkFault.model_validate({"name": str(fault), "start_s": start, "stop_s": start + FAULT_LASTS_S})
            for fault, start in zip(drawn, starts.tolist(), strict=True)
        ]
        yield Speaker(name, outlet, line.source or outlet.place, line.carrier, faults, seconds)


def _dues(seconds: float) -> Iterator[Due]:
    bins = np.arange(512) // 16 % 2
    radials = [racklink.word_708(arinc708.encode(bins, scan_angle_deg=a, tilt_deg=-2.0, range_nm=10.0)) for a in ANGLES]
    words = [int(word) for word in arinc429.encode_data(0o377, [0x0B] * WORDS, ssm=0)]
    body = racklink.words_429([360_000 * k for k in range(WORDS)], words)
    for start in range(0, round(seconds * 1e9), BATCH_NS):
        end = start + BATCH_NS
        dues = [*bridge.routine(start, end), *(Due(end, bus, f.WORDS_429, start, body, WORDS) for bus in range(1, 5))]
        for number in range(-(-start // RADAR_NS), -(-end // RADAR_NS)):
            begun = number * RADAR_NS
            dues.append(Due(begun + 1_606_000, 0, f.WORD_708, begun, radials[number % len(ANGLES)], 1))
        yield from sorted(dues)
    yield bridge.heartbeat(round(seconds * 1e9))


def _sample(after_s: float, latest_s: float) -> Sample:
    files = len(list(Path("/proc/self/fd").iterdir()))
    return Sample(after_s, memory() / MIB, files, threading.active_count(), latest_s)


def _line(sample: Sample) -> str:
    return (
        f"{sample.after_s:6.0f} s  {sample.memory_mib:7.1f} MiB  {sample.files:3d} files  {sample.threads:2d} threads"
        f"  latest event {1e3 * sample.latest_s:6.1f} ms"
    )


def _growth(samples: list[Sample]) -> Iterator[str]:
    settled, last = samples[len(samples) // 3], samples[-1]
    if last.memory_mib - settled.memory_mib > GROWTH_MIB:
        yield f"memory grew by {last.memory_mib - settled.memory_mib:.0f} MiB"
    if last.files - settled.files > GROWTH_FILES:
        yield f"{last.files - settled.files} more files are open"
    if last.latest_s > LATEST_S:
        yield f"events come {last.latest_s:.1f} s late"


def _uncounted(speakers: list[Speaker], counters: dict[str, int]) -> Iterator[str]:
    for speaker in speakers:
        lost = arrived = 0
        for (channel, _), carried in speaker.ledger.carried.items():
            books = [counters[f"{speaker.name}.channel_{channel}.words{where}"] for where in WHERE]
            arrived, lost = arrived + books[0], lost + books[1] + books[2]
            if sum(books) != carried:
                yield f"{speaker.name} channel {channel}: {carried} sent; arrived, lost on link, in bridge: {books}"
        print(f"{speaker.name}: {arrived} words arrived, {lost} counted as lost")


if __name__ == "__main__":
    main()
