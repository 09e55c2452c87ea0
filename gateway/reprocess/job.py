"""One recording to work out again: everything that its result depends on, and the work."""

import hashlib
import json
from collections.abc import Iterable
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from gateway.chunks import blocks
from gateway.config import RackConfig
from gateway.core import Core
from gateway.errors import GatewayError
from gateway.events import Event, IntegrityEvent, ScanEvent, SummaryEvent
from gateway.exports.parquet import VERDICTS
from gateway.metadata import build_monitor, recorded_config, recorded_monitor
from gateway.pipeline import Pipeline
from gateway.recording import Recording
from gateway.recording.session import sessions
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
OF_THE_SCAN = ("radials", pa.int64()), ("range_nm", pa.float64()), ("tilt_deg", pa.float64())
COLUMNS = pa.schema([("recording", pa.string()), *OF_THE_SCAN, *VERDICTS])


class Job(NamedTuple):
    """A recording, as the data set names it and where it is, and what replaces the configuration that it was made with.

    `config` is a whole configuration as JSON, or empty; `terrain` and `water` are files, or none.
    """

    name: str
    path: Path
    config: str = ""
    terrain: tuple[Path, ...] = ()
    water: tuple[Path, ...] = ()


class Outcome(NamedTuple):
    """A row for each verdict, and what is said of the whole recording."""

    verdicts: pa.Table
    whole: dict[str, Any]


def key(job: Job) -> str:
    """A digest of all that the outcome depends on: recording, configuration, calibration, terrain, water and code.

    A file counts as the same while its size and time of change are. Raises GatewayError as `work` does.
    """
    recording = Recording(job.path)
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
    recording = Recording(job.path)
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
        "torn": recording.torn,
        "failures": failures,
        "counters": [{"name": name, "count": count} for name, count in counters.items()],
    }
    return Outcome(pa.Table.from_pylist(rows, COLUMNS), whole)


def set_up(job: Job, recording: Recording) -> tuple[RackConfig, Monitor | None]:
    """How a recording is to be read and judged. Raises GatewayError naming what is wrong."""
    recorded = recorded_config(recording.metadata)
    config = (RackConfig.model_validate_json(job.config) if job.config else recorded).with_maps(job.terrain, job.water)
    names, given = ({adapter.name for adapter in one.adapters} for one in (recorded, config))
    if not names & given:
        raise GatewayError(
            f"{job.path} was recorded from {', '.join(sorted(names))}, and the rack file names none of them: "
            f"give one of its adapters ({', '.join(sorted(given))}) that name"
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
    return {column: row[column] for column in COLUMNS.names if column in row}


@cache
def code_version() -> str:
    """A digest of the sources that decide what comes out of a recording."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    files = (path for package in CODE for path in (root / package).rglob("*") if path.suffix in (".py", ".toml"))
    for path in sorted(files):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def jobs(source: Path, config: RackConfig | None, terrain: Iterable[Path], water: Iterable[Path] = ()) -> list[Job]:
    """A job for each recording below a directory, or for one recording. Raises GatewayError if there is none."""
    directory = source.parent if source.is_file() else source
    paths = [source] if source.is_file() else [session[0] for session in sessions(directory.rglob("*.mcap"))]
    if not paths:
        raise GatewayError(f"{directory} holds no recordings (*.mcap): name the directory that they are in")
    written = json.dumps(config.model_dump(mode="json")) if config else ""
    maps = [tuple(path.absolute() for path in files) for files in (terrain, water)]
    names = [path.relative_to(directory).with_suffix("").as_posix() for path in paths]
    return [Job(name, path.absolute(), written, *maps) for name, path in zip(names, paths, strict=True)]
