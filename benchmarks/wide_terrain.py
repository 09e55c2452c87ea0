"""A hundred tiles of an arc-second, 10 x 10 degrees: `make wide-terrain`. Exits 1 if a claim does not hold.

The tiles are written first, by another process, so that the memory that is told is that of opening them and of judging
scans along a track from corner to corner. Scans at 40 NM lie 12 km apart, so that most lead into another piece, and
the first in a piece pays for reading it.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rasterio
from rasterio.transform import Affine

from decoders.formats import MODES_708
from monitor.aircraft import Aircraft
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import WideTerrain, open_terrain
from monitor.warmup import warm_up

SIDE, POSTS = 10, 3600  # degrees, posts to a degree
SOUTH, WEST = 40, 5
SCANS, RANGE_NM, BINS = 100, 40.0, 512
ANGLES_DEG = np.arange(-60.0, 60.5, 0.5)
OPEN_S, MOST_MIB = 2.0, 2048.0
SCAN_NS = 4_000_000_000


class Judged(NamedTuple):
    """Seconds for a scan, whether terrain was read for it, and the verdict's pairs."""

    seconds: float
    read: bool
    pairs: int


def main() -> None:
    """Write, open, fly, print, and judge the claims."""
    if len(sys.argv) > 1:
        write(Path(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory() as directory:
        subprocess.run([sys.executable, "-m", "benchmarks.wide_terrain", directory], check=True)  # noqa: S603 # ours
        began = time.monotonic()
        terrain = open_terrain(sorted(Path(directory).iterdir()))
        opened_s = time.monotonic() - began
        assert isinstance(terrain, WideTerrain)
        warm_up(Monitor(terrain, MonitorSettings(position_gate=False)))
        before_mib = _peak_mib()
        judged = fly(terrain)
    print(f"{SIDE * SIDE} tiles of {POSTS + 1} x {POSTS + 1} posts opened in {opened_s:.2f} s; claim: {OPEN_S:g} s")
    for told, some in (("with a piece to read", True), ("in pieces at hand", False)):
        seconds = [one.seconds for one in judged if one.read == some]
        print(f"{len(seconds)} scans {told}: median {np.median(seconds):.3f} s, slowest {max(seconds):.3f} s")
    print(f"the first scan: {judged[0].seconds:.3f} s; pairs of all scans: {sum(one.pairs for one in judged)}")
    peak_mib = _peak_mib()
    print(f"peak memory {peak_mib:.0f} MiB, {before_mib:.0f} of them before the first scan; claim: {MOST_MIB:g} MiB")
    sys.exit(0 if opened_s < OPEN_S and peak_mib < MOST_MIB else 1)


def write(directory: Path) -> None:
    """Ridges and valleys that differ from tile to tile, with a row or column in common."""
    half = 0.5 / POSTS
    profile = {"driver": "GTiff", "count": 1, "dtype": "int16", "crs": "EPSG:4326", "compress": "deflate", "zlevel": 1}
    for south in range(SOUTH, SOUTH + SIDE):
        for west in range(WEST, WEST + SIDE):
            along, across = (np.round(400 * np.sin(np.arange(POSTS + 1) * 2 * np.pi / 200)) for _ in range(2))
            height_m = (1000 + 10 * (south - SOUTH) + along[:, None] + across[None, :]).astype(np.int16)
            with rasterio.open(
                directory / f"N{south:02d}E{west:03d}.tif", "w", height=POSTS + 1, width=POSTS + 1,
                transform=Affine(1 / POSTS, 0, west - half, 0, -1 / POSTS, south + 1 + half), **profile,
            ) as file:  # fmt: skip
                file.write(height_m, 1)


def fly(terrain: WideTerrain) -> list[Judged]:
    """Scans from the south-western corner to the north-eastern one, each judged with what it cost."""
    monitor = Monitor(terrain, MonitorSettings(position_gate=False))
    judged = []
    for number, share in enumerate(np.linspace(0.08, 0.92, SCANS)):
        now_ns = (number + 1) * SCAN_NS
        aircraft, scan = _flying(share, now_ns), _scan(number, now_ns)
        held = {*terrain.pieces}
        began = time.monotonic()
        verdict, comparison = monitor.judge(scan, aircraft)
        assert comparison is not None, verdict.reasons
        judged.append(Judged(time.monotonic() - began, {*terrain.pieces} != held, verdict.n_pairs))
    return judged


def _flying(share: float, now_ns: int) -> Aircraft:
    here = {
        "latitude_deg": SOUTH + share * SIDE,
        "longitude_deg": WEST + share * SIDE,
        "height_m": 2500.0,
        "heading_deg": 35.0,
    }
    aircraft = Aircraft()
    for quantity in NEEDED:
        values = np.full(2, here.get(quantity.name, 0.0))
        aircraft.tracks[quantity.name].append(now_ns + np.array([-1, 1]) * SCAN_NS // 40, values, np.zeros(2, np.uint8))
    return aircraft


def _scan(number: int, now_ns: int) -> Scan:
    """Bands of echoes, dark between them: what they are is no matter, as every scan costs the same."""
    n = len(ANGLES_DEG)
    return Scan(
        number=number,
        time_ns=np.full(n, now_ns),
        scan_angle_deg=ANGLES_DEG,
        beyond_limits=np.zeros(n, bool),
        bins=np.tile((3 * (np.arange(BINS) // 12 % 2)).astype(np.uint8), (n, 1)),
        tilt_deg=-2.0,
        range_nm=RANGE_NM,
        mode=MODES_708["map"],
        stabilised=True,
        faults=0,
        missing=0,
        repeated=0,
    )


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
