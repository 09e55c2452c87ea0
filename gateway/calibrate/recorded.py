"""One recording for a calibration: what each of its scans compared, and which recording it was."""

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gateway.chunks import blocks
from gateway.config import RackConfig
from gateway.core import Core
from gateway.errors import GatewayError
from gateway.pipeline import Pipeline
from gateway.recording import Recording
from gateway.reprocess.job import Job
from gateway.reprocess.work import RECORDS_AT_ONCE, set_up
from monitor.comparison import Comparison
from monitor.integrity import Monitor
from monitor.residuals import residuals
from monitor.sample import ScanSample
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.verdict import Verdict

LARGEST_SIZES = (64, 32, 16, 8)  # range bins, Table 3
SHARES_OF_RANGE = (1.0, 0.5, 0.25)  # of the range setting; 20, 10 and 5 NMI of the paper's radar
CELLS = tuple((share, size) for share in SHARES_OF_RANGE for size in LARGEST_SIZES)


class Setting(NamedTuple):
    """What a calibration is for."""

    bins: int
    range_nm: float
    radar_profile: str

    def __str__(self) -> str:
        return f"{self.bins} bins, {self.range_nm:g} NM and profile {self.radar_profile}"


class Compared(NamedTuple):
    """A scan of one radar setting: what the tests look at in flight, and residuals of centres for each cell."""

    setting: Setting
    sample: ScanSample
    centres: tuple[NDArray[np.float64], ...]


@dataclass
class Read:
    """What a recording gave. `begins_utc_ns` is None of one without records."""

    name: str
    digest: str
    terrain: str
    settings: MonitorSettings
    begins_utc_ns: int | None = None
    damage: str = ""
    scans: list[Compared] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)  # why other scans were not compared


def read(job: Job) -> Read:
    """All scans of a recording. Raises GatewayError naming what is wrong."""
    recording = Recording(job.files)
    config, recorded = set_up(job, recording)
    if recorded is None:
        raise GatewayError(f"{job.path} was recorded without terrain: name the reference terrain with --dem")
    # Without a calibration, which some scans may not be for.
    monitor = Monitor(recorded.terrain, recorded.settings, water=recorded.water)
    found = Read(job.name, _digest(recording), _reference(config, monitor), monitor.settings)

    def watch(scan: Scan, verdict: Verdict, comparison: Comparison | None) -> None:
        if comparison is None:
            found.refusals[verdict.reasons[0]] += 1
        else:
            found.scans.append(_compared(scan, comparison))

    failures: list[str] = []
    core = Core(
        lambda before: Pipeline(config, monitor, watch, before, tells_state=False), lambda _: None, failures.append
    )
    for block in blocks(recording.runs(), RECORDS_AT_ONCE):
        found.begins_utc_ns = found.begins_utc_ns or block.first.stamp.utc_ns
        core.process_all(block)
    core.finish()
    if failures:
        raise GatewayError(f"{job.path}: {failures[0]}; leave it out of the calibration, and tell us")
    found.damage = "; ".join(recording.complaints)
    return found


def _compared(scan: Scan, comparison: Comparison) -> Compared:
    bins = scan.bins.shape[1]
    centres = []
    for share, size in CELLS:
        limit = int(share * bins)
        radar, dem = comparison.radar_states[:, :limit], comparison.dem_states[:, :limit]
        centres.append(residuals(radar, dem, (1, size), "overlap").centre)
    return Compared(Setting(bins, scan.range_nm, scan.profile), comparison.sample(scan), tuple(centres))


def _reference(config: RackConfig, monitor: Monitor) -> str:
    """The terrain, and the water over which nothing counts, with their checksums."""
    said = f"{', '.join(path.name for path in monitor.terrain.paths)} (checksum {monitor.terrain.checksum})"
    if not monitor.water:
        return said
    return f"{said} without water {', '.join(path.name for path in config.water)} (checksum {monitor.water.checksum})"


def _digest(recording: Recording) -> str:
    """The SHA-256 of all files of a recording, one after the other."""
    digest = hashlib.sha256()
    for path in recording.files:
        with path.open("rb") as file:
            while piece := file.read(1 << 20):
                digest.update(piece)
    return digest.hexdigest()
