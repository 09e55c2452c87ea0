"""The work on one recording, and everything that its outcome depends on."""

import hashlib
import json
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from gateway.chunks import blocks
from gateway.config import RackConfig
from gateway.core import Core
from gateway.errors import GatewayError
from gateway.events import Event, IntegrityEvent, ScanEvent, SummaryEvent
from gateway.framing import form_of
from gateway.metadata import build_monitor, recorded_config, recorded_monitor
from gateway.pipeline import Pipeline
from gateway.recording import Recording
from gateway.reprocess.job import Job, Outcome
from monitor.integrity import Monitor

RECORDS_AT_ONCE = 1024
MADE_WITH = (
    "configuration",
    "calibration",
    "terrain_checksum",
    "water_checksum",
)  # of the metadata, what decides how it is judged
SET_UPS = 4  # kept: each has its terrain in memory
CODE = ("decoders", "monitor", "gateway")  # whose sources decide what comes out


def key(job: Job) -> str:
    """A digest of all that the outcome depends on: recording, configuration, calibration, terrain, water and code.

    A file counts as the same while its size and time of change are. Raises GatewayError as `work` does.
    """
    recording = Recording(job.files)
    return _key(recording, *set_up(job, recording))


def _key(recording: Recording, config: RackConfig, monitor: Monitor | None) -> str:
    files = [(str(path), *_size_and_change(path)) for path in recording.files]
    calibration = monitor.calibration.model_dump_json() if monitor and monitor.calibration else ""
    terrain = monitor.terrain.checksum if monitor else ""
    water = monitor.water.checksum if monitor and monitor.water else ""
    said = [files, config.model_dump_json(), calibration, terrain, water, code_version()]
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()


def work(job: Job) -> Outcome:
    """Decode and judge a recording from its first record to its last. Raises GatewayError naming what is wrong."""
    recording = Recording(job.files)
    config, monitor = set_up(job, recording)
    rows: list[dict[str, Any]] = []
    counters: dict[str, int] = {}
    scan: ScanEvent | None = None

    def take(event: Event) -> None:
        nonlocal scan
        if isinstance(event, ScanEvent):
            scan = event
        elif isinstance(event, IntegrityEvent):
            rows.append(_row(job.name, event, scan if scan and scan.scan == event.scan else None))
        elif isinstance(event, SummaryEvent):
            counters.update(event.counters)

    failures: list[str] = []
    core = Core(lambda before: Pipeline(config, monitor, before=before, tells_state=False), take, failures.append)
    first = last = None
    for block in blocks(recording.runs(), RECORDS_AT_ONCE):
        first, last = first or block.first.stamp, block.last.stamp
        core.process_all(block)
    core.finish()
    whole = {
        "recording": job.name,
        "key": _key(recording, config, monitor),
        "begins_utc_ns": first.utc_ns if first else None,
        "seconds": (last.monotonic_ns - first.monotonic_ns) / 1e9 if first and last else 0.0,
        "records": recording.records,
        "damaged": recording.damaged,
        "missing": recording.missing,
        "torn": recording.torn,
        "failures": failures,
        "counters": [{"name": name, "count": count} for name, count in counters.items()],
    }
    return Outcome(rows, whole)


def set_up(job: Job, recording: Recording) -> tuple[RackConfig, Monitor | None]:
    """How a recording is to be read and judged. Raises GatewayError naming what is wrong."""
    recorded = recorded_config(recording.metadata, job.path)
    config = (RackConfig.model_validate_json(job.config) if job.config else recorded).with_maps(job.terrain, job.water)
    names, given = ({adapter.name for adapter in one.adapters} for one in (recorded, config))
    if not names & given:
        raise GatewayError(
            f"{job.path} was recorded from {', '.join(sorted(names))}, and the rack file names none of them: "
            f"give one of its adapters ({', '.join(sorted(given))}) that name"
        )
    for before, now in ((a, b) for a in recorded.adapters for b in config.adapters if a.name == b.name):
        if form_of(before)[1:] != form_of(now)[1:]:
            raise GatewayError(
                f"{job.path} was recorded from {before.source}, whose bytes are read in another way than those of "
                f"{now.source}: give {now.name} the kind of line that it had"
            )
    maps = (*config.terrain, *config.water, *((config.calibration,) if config.calibration else ()))
    files = [(path, *_size_and_change(path)) for path in maps if path.exists()]
    made_with = tuple((name, recording.metadata[name]) for name in MADE_WITH if name in recording.metadata)
    return _made(job.config, job.terrain, job.water, made_with, tuple(files))


@lru_cache(maxsize=SET_UPS)
def _made(
    config: str,
    terrain: tuple[Path, ...],
    water: tuple[Path, ...],
    metadata: tuple[tuple[str, str], ...],
    _: tuple[tuple[Path, int, int], ...],
) -> tuple[RackConfig, Monitor | None]:
    """The same for all recordings that were made alike, as long as the files that it rests on are the same."""
    if not config:
        recorded = recorded_config(dict(metadata)).with_maps(terrain, water)
        return recorded, recorded_monitor(dict(metadata), recorded, terrain, water)
    given = RackConfig.model_validate_json(config).with_maps(terrain, water)
    return given, build_monitor(given)


def _size_and_change(path: Path) -> tuple[int, int]:
    """While both are the same, a file counts as the same: bytes, and ns of its last change."""
    found = path.stat()
    return found.st_size, found.st_mtime_ns


def _row(name: str, event: IntegrityEvent, scan: ScanEvent | None) -> dict[str, Any]:
    row = {**vars(event), "recording": name, "utc_ns": event.time_ns}
    if scan:
        row |= {"radials": scan.radials, "range_nm": scan.range_nm, "tilt_deg": scan.tilt_deg}
    return row


@cache
def code_version() -> str:
    """A digest of the sources that decide what comes out of a recording."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    files = (path for package in CODE for path in (root / package).rglob("*") if path.suffix in (".py", ".toml"))
    for path in sorted(files):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
