"""Recordings in other people's formats, one module each: `FORMATS` names them, and a module is imported when chosen.

A module has `export(job, path) -> str`, which writes the path and says in words what it wrote.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from gateway.config import RackConfig
from gateway.errors import GatewayError
from gateway.metadata import recorded_config
from gateway.recording import Recording
from gateway.records import Record
from gateway.stopping import Stop
from gateway.words import Item, WordStage

FORMATS = {
    "cfradial": "gateway.exports.cfradial",
    "chapter10": "gateway.exports.chapter10",
    "parquet": "gateway.exports.parquet",
    "candump": "gateway.exports.candump",
    "csv": "gateway.exports.label_csv",
}


@dataclass
class Job:
    """A recording to export, the terrain instead of the recorded one or none at all, and what was left out so far."""

    recording: Recording
    config: RackConfig
    stop: Stop
    terrain: tuple[Path, ...] = ()
    without_terrain: bool = False
    left_out: dict[str, int] = field(default_factory=dict)  # counts by what it is
    failures: list[str] = field(default_factory=list)  # of the pipeline: defects, not data

    def records(self) -> Iterator[Record]:
        """The records in order; a signal ends the process between two of them."""
        return self.stop.until(self.recording)

    def words(self) -> Iterator[Item]:
        """The words of the recording in order; at the end it is known what became none."""
        stage = WordStage(self.config)
        for record in self.records():
            yield from stage.feed(record)
        self.left_out |= stage.left_out()


def export(
    recording: Path, form: str, path: Path, stop: Stop, terrain: tuple[Path, ...] = (), without_terrain: bool = False
) -> list[str]:
    """Write a recording in a format to a path that is not there yet; what was written and left out, in words.

    Raises GatewayError for an unknown format, a path that exists or cannot be written, and whatever else is wrong.
    """
    if form not in FORMATS:
        raise GatewayError(f"no format {form!r}: name one of {', '.join(FORMATS)}")
    source = Recording(recording)
    job = Job(source, recorded_config(source.metadata, recording), stop, terrain, without_terrain)
    write = import_module(FORMATS[form]).export
    with fresh(path) as place:
        said = [f"{path}: {write(job, place)}"]
    said += [f"left out: {count} {what}" for what, count in job.left_out.items() if count]
    if source.losses:
        said.append(f"the recording has {', '.join(source.losses)}; every whole record is in")
    if source.torn:
        said.append(f"{source.torn}; every whole record is in")
    return said + [f"a defect cost part of a scan: {failure}" for failure in job.failures]


@contextmanager
def fresh(path: Path) -> Iterator[Path]:
    """A place beside a path that becomes it at the end, so that what is there under its name is whole.

    Raises GatewayError if the path exists or cannot be written; nothing is ever overwritten.
    """
    part = path.with_name(f"{path.name}.part")
    for taken in (path, part):
        if taken.exists():
            raise GatewayError(f"{taken} exists already: choose another path with -o, or move it away")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.rename(path)
    except OSError as error:
        raise GatewayError(f"cannot write {path}: {error.strerror or error}; choose another place with -o") from error
    finally:
        if part.is_dir():
            shutil.rmtree(part)
        elif part.exists():
            part.unlink()
