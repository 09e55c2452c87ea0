"""How many times real time recorded flights are worked out again on all cores. `make hours`.

A recorded flight is two minutes over real terrain: a radar of 80 words/s, an IRU, a GNSS receiver and a radio
altimeter, in packets and chunks of 10 ms. An hour is thirty such recordings. The IRU and the GNSS receiver send every
label of their sets at its shortest interval, or their buses are full to the brim (2778 words/s each). What is timed is
the command `shadebus reprocess` from its start to its end, beside a copy of the files. What an hour more costs says
whether the cost is linear: the start, some seconds of imports, is in every run.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import psutil
from numpy.typing import NDArray

from benchmarks.load import BUSES, USED
from decoders import formats as f
from decoders.definitions import load_definitions
from decoders.racklink import Framer, Packet, words429
from gateway.config import check_config
from gateway.metadata import build_monitor, describe
from gateway.recording import Recorder
from gateway.records import Raw, Record, Stamp, Tick
from monitor.utc import UTC_LABELS
from simulators import arinc429, racklink
from simulators.link import whole_stream
from simulators.scenario import BUILT_IN_TERRAIN, white_mountains

SECONDS = 120
AN_HOUR = 3600 // SECONDS
HOURS = (1, 4, 16)
CHUNK_NS = 10_000_000
SECOND_NS = 1_000_000_000
WORD_NS = f.WORD_429_BIT_TIMES * f.HIGH_SPEED_BIT_NS
FULL = (1, 2)  # channels: IRU and GNSS
EPOCH_NS = 1_780_000_000 * SECOND_NS


def main() -> None:
    """Print a line for each number of hours, and what an hour more costs, with either load."""
    with tempfile.TemporaryDirectory() as directory:
        for load, brim in (("every label at its shortest interval", False), ("buses full to the brim", True)):
            place = Path(directory) / f"{brim}"
            place.mkdir()
            record(place / "flight.mcap", brim=brim)
            size_mib = (place / "flight.mcap").stat().st_size * AN_HOUR / 2**20
            print(f"{load}: {size_mib:.0f} MiB an hour, in {AN_HOUR} recordings")
            whole_s = {hours: _measure(place / f"{hours}", place / "flight.mcap", hours) for hours in HOURS}
            for few, many in pairwise(HOURS):
                more_s = (whole_s[many] - whole_s[few]) / (many - few)
                print(f"from {few} to {many} h an hour more costs {more_s:.2f} s: {3600 / more_s:.0f} times real time")


def _measure(place: Path, flight: Path, hours: int) -> float:
    """Print what so many hours cost; how many seconds the whole command took."""
    recordings = place / "recordings"
    recordings.mkdir(parents=True)
    for number in range(hours * AN_HOUR):
        (recordings / f"{number:03d}.mcap").hardlink_to(flight)
    began = time.perf_counter()
    shutil.copytree(recordings, place / "copy")
    copied_s = time.perf_counter() - began
    shutil.rmtree(place / "copy")
    began = time.perf_counter()
    shadebus = Path(sys.executable).with_name("shadebus")
    command = [str(part) for part in (shadebus, "reprocess", recordings, "-o", place / "out")]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as running:  # noqa: S603 # our own command
        largest_mib = _watch(running)
    whole_s = time.perf_counter() - began
    marks = sorted(path.stat().st_mtime_ns / 1e9 for path in (place / "out" / "recordings").iterdir())
    if running.returncode or len(marks) != hours * AN_HOUR:
        raise SystemExit(f"{len(marks)} of {hours * AN_HOUR} were worked out")
    flown_s = hours * 3600.0
    steady = SECONDS * (len(marks) - 1) / (marks[-1] - marks[0])  # from the first result to the last
    print(
        f"{hours:2d} h: {whole_s:6.1f} s, {flown_s / whole_s:4.0f} times real time; from the first result on "
        f"{steady:4.0f} times; {whole_s / copied_s:.0f} times a copy of the files ({copied_s:.2f} s); "
        f"largest worker {largest_mib:.0f} MiB",
        flush=True,
    )
    return whole_s


def _watch(running: subprocess.Popen[bytes]) -> float:
    """Wait for a command to end; the most memory that one of the processes below it had, MiB."""
    largest = 0.0
    while running.poll() is None:
        time.sleep(0.2)
        for process in psutil.Process().children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                largest = max(largest, process.memory_info().rss / 2**20)
    return largest


def record(path: Path, *, brim: bool = True) -> None:
    """Record the two minutes, the buses full to the brim or as full as their labels make them."""
    chunks: dict[int, list[Packet]] = {}
    for packet in _packets(brim):
        chunks.setdefault(packet.time_ns // CHUNK_NS, []).append(packet)
    records: list[Record] = []
    sequence = 0
    for chunk in sorted(chunks):
        stamp = Stamp((chunk + 1) * CHUNK_NS, (chunk + 1) * CHUNK_NS + EPOCH_NS)
        encoded = [
            racklink.encode(p.type, p.channel, sequence + k, p.time_ns, p.body) for k, p in enumerate(chunks[chunk])
        ]
        sequence += len(encoded)
        records.append(Raw(len(records), stamp, "bridge", b"".join(encoded)))
        if chunk * CHUNK_NS % SECOND_NS == 0:
            records.append(Tick(len(records), stamp))
    table = {"adapters": [{"name": "bridge", "source": "serial:x"}], "terrain": [BUILT_IN_TERRAIN["white_mountains"]]}
    config = check_config(table, "hours")
    recorder = Recorder(path, describe(config, build_monitor(config)))
    recorder.append(records)
    recorder.close()


def _packets(brim: bool) -> list[Packet]:
    flown = Framer().feed(whole_stream(white_mountains(SECONDS)))
    packets = [p for p in flown if p.type != f.WORDS_429 or p.channel not in FULL]
    for channel in FULL:
        own = [words429(p) for p in flown if p.type == f.WORDS_429 and p.channel == channel]
        times_ns, words = np.concatenate([w.time_ns for w in own]), np.concatenate([w.words for w in own])
        packets += _full_bus(channel, times_ns, words.astype(np.int64), brim)
    return sorted(packets, key=lambda packet: packet.time_ns)


def _full_bus(channel: int, times_ns: NDArray[np.int64], words: NDArray[np.int64], brim: bool) -> list[Packet]:
    """The bus of a flight with labels in its free slots that are decoded and used for nothing."""
    definitions = load_definitions(BUSES[channel])
    labels = sorted(definitions.labels.keys() - USED - UTC_LABELS)
    free = np.setdiff1d(np.arange(SECONDS * SECOND_NS // WORD_NS), times_ns // WORD_NS) * WORD_NS
    number = np.arange(len(free)) % len(labels)
    if not brim:
        due = [(at, k) for k, label in enumerate(labels) for at in _due_ns(definitions.labels[label].interval_ms)]
        due_ns, number = np.array(sorted(due)).T
        slot = np.searchsorted(free, due_ns)  # the next that is free, and not taken by one that was due before
        free = free[np.maximum.accumulate(slot - np.arange(len(slot))) + np.arange(len(slot))]
    fillers = np.array([int(arinc429.encode_data(label, [0], ssm=3)[0]) for label in labels])
    times_ns = np.r_[times_ns, free]
    words = np.r_[words, fillers[number]]
    order = np.argsort(times_ns, kind="stable")
    times_ns, words = times_ns[order], words[order]
    cuts = np.flatnonzero(np.diff(times_ns // CHUNK_NS)) + 1
    packets = []
    for some_ns, some in zip(np.split(times_ns, cuts), np.split(words, cuts), strict=True):
        body = racklink.words_429((some_ns - some_ns[0]).tolist(), some.tolist())
        packets.append(Packet(f.WORDS_429, channel, 0, 0, int(some_ns[0]), body))
    return packets


def _due_ns(interval_ms: tuple[float, float | None] | None) -> range:
    """When a label is due; one whose shortest interval is nothing, at its longest, and one without any each second."""
    shortest, longest = interval_ms or (0.0, 0.0)
    return range(0, (SECONDS - 1) * SECOND_NS, round(1e6 * (shortest or longest or 1000.0)))


if __name__ == "__main__":
    main()
