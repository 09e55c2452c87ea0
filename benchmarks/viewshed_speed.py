"""How much quicker the terrain thread of one scan is than one call of gdal_viewshed, in processor time.

The call works on the whole tile, as the thread has it; for comparison, also on nothing but the ground in range. Times
are the processor's, which depend little on what else the machine does, and the least of many rounds.
"""

import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.viewsheds import Surroundings, run_gdal, surroundings, write
from monitor.geodesy import NM_M
from monitor.prediction import Beam, Pointing, predict
from monitor.terrain import open_terrain
from simulators.scenario import BUILT_IN_TERRAIN

TILE = BUILT_IN_TERRAIN["white_mountains"]
LATITUDE, LONGITUDE, ABOVE_GROUND_M = 44.5, -71.5, 350.0  # the middle of the tile
RADIALS, BINS, RANGE_NM = 360, 512, 10.0
BEAM = Beam(width_deg=178.0, azimuth_fan=1)
POST_M = 90.0
GROUNDS_M = {
    "tile": 47_000.0,
    "range": RANGE_NM * NM_M,
    "start": POST_M,
}  # to each side; the first is as much ground as the tile
CALLS, SCANS = 20, 200
TIMES_QUICKER, TIMES_QUICKER_NET = 20, 8


def section() -> list[str]:
    """The report's lines, as Markdown."""
    thread_s = least(scan(), time.process_time, SCANS)
    with tempfile.TemporaryDirectory() as directory:
        spent_s = {name: least(call(Path(directory), name), _of_children, CALLS) for name in GROUNDS_M}
    start_s = spent_s["start"]
    ratio, net, in_range = (
        s / thread_s for s in (spent_s["tile"], spent_s["tile"] - start_s, spent_s["range"] - start_s)
    )
    return [
        f"{RADIALS} radials x {BINS} bins, {RANGE_NM:g} NM, boresight alone, in line of sight; ms of a processor:",
        "",
        f"| the thread | {1e3 * thread_s:.2f} | claim |",
        "|---|---|---|",
        f"| one call of gdal_viewshed on the tile | {1e3 * spent_s['tile']:.0f} | |",
        f"| its start alone | {1e3 * start_s:.0f} | |",
        f"| the call over the thread | {ratio:.0f} times | {TIMES_QUICKER}: {_word(ratio >= TIMES_QUICKER)} |",
        f"| without its start | {net:.1f} times | {TIMES_QUICKER_NET}: {_word(net >= TIMES_QUICKER_NET)} |",
        f"| the same on nothing but the ground in range | {_times(in_range)} | none |",
    ]


def ground(name: str) -> Surroundings:
    """The tile, or a part of it, about its middle."""
    return surroundings(TILE, LATITUDE, LONGITUDE, GROUNDS_M[name], POST_M)


def call(directory: Path, name: str) -> Callable[[], None]:
    """One run of gdal_viewshed on one of `GROUNDS_M`, whose file is made beforehand."""
    stored = directory / f"{name}.tif"
    write(ground(name), stored)
    return lambda: run_gdal(stored, directory / "seen.tif", 0.0, 0.0, ABOVE_GROUND_M)


def scan() -> Callable[[], object]:
    """One scan of the terrain thread from the same place."""
    ones = np.ones(RADIALS)
    here = LATITUDE * ones, LONGITUDE * ones, (ground("start").ground_m + ABOVE_GROUND_M) * ones
    pointing, grid = Pointing(*here, np.radians(np.arange(RADIALS)), 0 * ones), open_terrain(TILE).grid
    return lambda: predict(grid, pointing, BINS, RANGE_NM * NM_M / BINS, BEAM)


def least(work: Callable[[], object], clock: Callable[[], float], rounds: int) -> float:
    """Of many rounds, seconds; the first does not count, since it loads what was compiled."""
    work()
    times = []
    for _ in range(rounds):
        began = clock()
        work()
        times.append(clock() - began)
    return min(times)


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _word(good: bool) -> str:
    return "holds" if good else "FAILS"


def _times(ratio: float) -> str:
    return f"{ratio:.1f} times" if ratio > 0 else "less than its start varies by"
