"""One recording to work out again, and what comes of it."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gateway.errors import GatewayError
from gateway.recording.session import files_of, sessions

if TYPE_CHECKING:
    from gateway.config import RackConfig


class Job(NamedTuple):
    """A recording, as the data set names it and its files, and what replaces the configuration that it was made with.

    `config` is a whole configuration as JSON, or empty; `terrain` and `water` are files, or none.
    """

    name: str
    files: tuple[Path, ...]
    config: str = ""
    terrain: tuple[Path, ...] = ()
    water: tuple[Path, ...] = ()

    @property
    def path(self) -> Path:
        """The first of its files, which stands for it."""
        return self.files[0]


class Outcome(NamedTuple):
    """A row for each verdict, and one of the whole recording: by column what the data set keeps, and more."""

    verdicts: list[dict[str, Any]]
    whole: dict[str, Any]


def jobs(source: Path, config: "RackConfig | None", terrain: Iterable[Path], water: Iterable[Path] = ()) -> list[Job]:
    """A job for each recording below a directory, or for one recording. Raises GatewayError if there is none."""
    directory = source.parent if source.is_file() else source
    found = [files_of(source)] if source.is_file() else sessions(directory.rglob("*.mcap"))
    if not found:
        raise GatewayError(f"{directory} holds no recordings (*.mcap): name the directory that they are in")
    written = json.dumps(config.model_dump(mode="json")) if config else ""
    maps = [tuple(path.absolute() for path in files) for files in (terrain, water)]
    names = [files[0].relative_to(directory).with_suffix("").as_posix() for files in found]
    every = [tuple(path.absolute() for path in files) for files in found]
    return [Job(name, files, written, *maps) for name, files in zip(names, every, strict=True)]
