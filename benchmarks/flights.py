"""Simulated flights through the decoders and the monitor, byte for byte, as fast as they compute."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from gateway.config import check_config
from gateway.metadata import build_monitor
from gateway.pipeline import Pipeline
from gateway.records import Raw, Stamp
from monitor.calibration import Calibration
from monitor.comparison import Comparison
from monitor.sample import NOTHING, ScanSample
from monitor.scans import Scan
from monitor.verdict import Verdict
from simulators.carriers import stream
from simulators.link import units
from simulators.scenario import Scenario

BATCH = 64


@dataclass(frozen=True)
class Flight:
    """A scenario, the terrain that the monitor has of it, and how it is to judge."""

    scenario: Scenario
    terrain: Path
    p_fa: float
    calibration: Calibration | None = None
    radar_profile: str | None = None  # instead of the one that the radar's payload has


@dataclass(frozen=True)
class Judged:
    """One scan of a flight: its verdict, and what the tests looked at."""

    verdict: Verdict
    sample: ScanSample


def fly(flight: Flight) -> list[Judged]:
    """The judged scans of a flight, in order."""
    rack = {
        "adapters": [{"name": "bridge", "source": "serial:none"}],
        "terrain": [flight.terrain],
        "radar_profile": flight.radar_profile or flight.scenario.radar.payload,
        "monitor": {"p_fa": flight.p_fa},
    }
    config = check_config(rack, "flight")
    judged: list[Judged] = []

    def watch(scan: Scan, verdict: Verdict, comparison: Comparison | None) -> None:
        judged.append(Judged(verdict, comparison.sample(scan) if comparison else NOTHING))

    pipeline = Pipeline(config, build_monitor(config, flight.calibration), watch)
    for number, (time_ns, data) in enumerate(units(flight.scenario, stream())):
        for _ in pipeline.feed(Raw(number, Stamp(time_ns, time_ns), "bridge", data)):
            pass
    for _ in pipeline.finish():
        pass
    return judged


def fly_all(flights: Iterable[Flight]) -> Iterator[list[Judged]]:
    """The judged scans of many flights, in order, on all cores; flights are drawn as they are needed."""
    flights = iter(flights)
    with ProcessPoolExecutor() as pool:
        while batch := list(islice(flights, BATCH)):
            yield from pool.map(fly, batch)
