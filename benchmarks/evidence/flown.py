"""Simulated flights, each judged as it is and under every fault, once for all tests and all calibrations."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from benchmarks.evidence.faults import FAULTS, NONE, Fault
from gateway.config import check_config
from gateway.pipeline import Pipeline
from gateway.records import Raw, Stamp
from monitor.comparison import Comparison
from monitor.integrity import Monitor
from monitor.sample import NOTHING, ScanSample
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import Grid, Terrain, open_terrain
from monitor.verdict import Verdict
from simulators.campaign import draw_legs
from simulators.carriers import stream
from simulators.link import units
from simulators.scenario import BUILT_IN_TERRAIN, Scenario, white_mountains

WHITE_MOUNTAINS, SIERRA = "White Mountains", "Sierra Nevada"
TERRAINS = {
    WHITE_MOUNTAINS: BUILT_IN_TERRAIN["white_mountains"],
    SIERRA: Path(__file__).parents[2] / "tests" / "data" / "terrain" / "sierra_nevada_1arcsec_wgs84.tif",
}
CLEARANCES_M = ((150.0, 250.0), (350.0, 450.0), (700.0, 800.0))  # above the highest ground under the leg
SETTINGS = MonitorSettings(offset_search_m=0)
ROUGHNESS_KM = 5.0


@dataclass(frozen=True)
class Kind:
    """A set of flights that differ by chance alone."""

    terrain: str
    clearance_m: tuple[float, float]
    snr_db: float = 18.0
    post_noise_m: float = 3.0


@dataclass(frozen=True)
class Flown:
    """One flight: for each fault what every scan gave, how high it was, and how rough the ground below."""

    kind: Kind
    samples: dict[str, list[ScanSample]]
    height_above_ground_m: float
    roughness_m: float


def fly(kinds: Sequence[Kind], flights: int, scans: int, seed: int, faults: Sequence[Fault] = (NONE,)) -> list[Flown]:
    """So many flights of each kind, of so many scans, under each of the faults; on all cores."""
    with ProcessPoolExecutor() as pool:
        return list(pool.map(_fly, *zip(*_plans(kinds, flights, scans, seed, faults), strict=True)))


def _plans(
    kinds: Sequence[Kind], flights: int, scans: int, seed: int, faults: Sequence[Fault]
) -> Iterator[tuple[Kind, int, int, int, int, tuple[str, ...]]]:
    names = tuple(fault.name for fault in faults)
    for k, kind in enumerate(kinds):
        for number in range(flights):
            yield kind, seed + 1000 * k, number, flights, scans, names


def _fly(kind: Kind, seed: int, number: int, flights: int, scans: int, names: tuple[str, ...]) -> Flown:
    leg = _legs(kind, seed, flights, scans)[number]
    config = check_config({"adapters": [{"name": "bridge", "source": "serial:none"}]}, "flight")
    terrain = _terrain(kind.terrain)
    samples: dict[str, list[ScanSample]] = {name: [] for name in names}
    place: list[tuple[float, float]] = []

    def watch(scan: Scan, _verdict: Verdict, _comparison: Comparison | None) -> None:
        for name, told in samples.items():
            fault = _fault(name)
            grid = _grid(kind.terrain, name)
            grid = fault.terrain(grid, number, len(told)) if fault.terrain else grid
            given = fault.scan(scan) if fault.scan else scan
            _, comparison = Monitor(Terrain(grid, (), ""), SETTINGS).judge(given, pipeline.aircraft)
            told.append(comparison.sample(given) if comparison else NOTHING)
        latitude, longitude, height = (
            float(pipeline.aircraft.tracks[name].at(scan.time_ns[:1]).value[0])
            for name in ("latitude_deg", "longitude_deg", "height_m")
        )
        place.append((height - float(terrain.elevation(latitude, longitude)), _roughness(terrain, latitude, longitude)))

    pipeline = Pipeline(config, Monitor(terrain, SETTINGS), watch)
    for count, (time_ns, data) in enumerate(units(leg, stream())):
        pipeline.feed(Raw(count, Stamp(time_ns, time_ns), "bridge", data))
    pipeline.finish()
    above, rough = np.nanmean(np.array(place or [(np.nan, np.nan)]), axis=0)
    return Flown(kind, samples, float(above), float(rough))


def _roughness(terrain: Terrain, latitude_deg: float, longitude_deg: float) -> float:
    """The standard deviation of the ground within a square of 10 km."""
    reach = np.linspace(-ROUGHNESS_KM, ROUGHNESS_KM, 41) / 111.132
    north, east = np.meshgrid(latitude_deg + reach, longitude_deg + reach / np.cos(np.radians(latitude_deg)))
    return float(np.nanstd(terrain.elevation(north, east)))


@lru_cache(maxsize=4)
def _legs(kind: Kind, seed: int, flights: int, scans: int) -> list[Scenario]:
    base = white_mountains(seed=seed)
    path = TERRAINS[kind.terrain]
    world = base.world.model_copy(
        update={"terrain": str(path), "incomplete": kind.terrain == SIERRA, "post_noise_m": kind.post_noise_m}
    )
    tilt_deg = -1.0 if kind.terrain == SIERRA else -2.0
    radar = base.radar.model_copy(update={"snr_db": kind.snr_db, "tilt_deg": tilt_deg})
    base = base.model_copy(update={"world": world, "radar": radar})
    return list(draw_legs(base, flights, seed, scans=scans, clearance_m=kind.clearance_m))


@cache
def _terrain(name: str) -> Terrain:
    return open_terrain(TERRAINS[name])


@cache
def _grid(terrain: str, fault: str) -> Grid:
    grid, rebuilt = _terrain(terrain).grid, _fault(fault).rebuilt
    return rebuilt(grid) if rebuilt else grid


@cache
def _fault(name: str) -> Fault:
    return next(fault for fault in FAULTS if fault.name == name)
