"""A recording to read: one file, or the files of a rotated session as if they were one."""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

from gateway.chunks import Run
from gateway.errors import GatewayError
from gateway.recording.layout import FORMAT_KEY, LAYOUTS, MAGIC
from gateway.recording.reader import OPENING, Damage, FileReader, Findings
from gateway.recording.window import Window
from gateway.records import Record

FOR_METADATA = 1 << 20  # of the beginning of a file
_FOLLOWER = re.compile(r"(.+)\.(\d{4,})")


def file_of_session(first: Path, number: int) -> Path:
    """The path of a session's file by its number, which counts from 1."""
    return first if number == 1 else first.with_name(f"{first.stem}.{number:04d}{first.suffix}")


class Recording:
    """A recording: its `metadata`, and an iterator over its records in the order they were accepted.

    A file that begins a session stands for all of it, and a directory for the only session in it; a list of files is
    read as it is. An iteration tells how many `records` were whole, how many places were `damaged`, the first of them
    in `damage`, and in `torn` of each file that does not end as it should. Raises GatewayError for what is missing or
    is no recording of ours.
    """

    def __init__(self, source: Path | Sequence[Path]) -> None:
        self.files = files_of(source) if isinstance(source, Path) else list(source)
        self.path = source if isinstance(source, Path) else self.files[0]
        self.metadata = metadata_of(self.files[0])
        self._found = Findings()

    @property
    def records(self) -> int:
        """Whole records in the last iteration."""
        return self._found.records

    @property
    def damaged(self) -> int:
        """Damaged places in the last iteration."""
        return self._found.damaged

    @property
    def damage(self) -> list[Damage]:
        """The first of them."""
        return self._found.places

    @property
    def torn(self) -> str:
        """What is to be said of files without their index."""
        return "; ".join(f"{path.name}: {text}" if len(self.files) > 1 else text for path, text in self._found.torn)

    def runs(self) -> Iterator[Run]:
        """The same records in runs, raw ones as columns."""
        self._found = found = Findings()
        return chain.from_iterable(_runs(path, found) for path in self.files)

    def __iter__(self) -> Iterator[Record]:
        return chain.from_iterable(self.runs())


def read_file(path: Path, found: Findings) -> Iterator[Record]:
    """The records of one file, which need not even be a recording: then all of it is damaged, or torn."""
    return chain.from_iterable(_runs(path, found))


def _runs(path: Path, found: Findings) -> Iterator[Run]:
    with Window(path) as window:
        yield from FileReader(path, window, found).runs()


def metadata_of(path: Path) -> dict[str, str]:
    """What a file says of itself. Raises GatewayError if it is no recording, or of a format that we do not know."""
    with Window(path) as window:
        window.end = min(window.end, FOR_METADATA)
        opening = window.get(0, len(OPENING))
        reader = FileReader(path, window, Findings())
        next(reader.records(), None)
    if not reader.metadata and opening != OPENING:
        if window.size < len(OPENING):
            raise GatewayError(f"{path} is not a shadebus recording: it ends before its first record")
        if opening.startswith(MAGIC):
            raise GatewayError(f"{path} is an MCAP file, but not a shadebus recording")
        raise GatewayError(f"{path} is not a shadebus recording: it is no MCAP file; look for another copy")
    version = reader.metadata.get(FORMAT_KEY, "1")
    if version not in LAYOUTS:
        raise GatewayError(f"{path} is of format {version}, which a later version of shadebus wrote: update shadebus")
    return reader.metadata


def sessions(files: Iterable[Path]) -> list[list[Path]]:
    """Files by the session that they belong to as their names say, each session's in order, whether it is all there."""
    found: dict[Path, list[tuple[int, Path]]] = {}
    for file in files:
        match = _FOLLOWER.fullmatch(file.stem)
        first = file.with_name(f"{match[1]}{file.suffix}") if match else file
        found.setdefault(first, []).append((int(match[2]) if match else 1, file))
    return [[file for _, file in sorted(group)] for _, group in sorted(found.items())]


def files_of(path: Path) -> list[Path]:
    """The files of a recording. Raises GatewayError for a directory that holds none or several."""
    if not path.is_dir():
        beside = sessions(path.parent.glob(f"*{path.suffix}"))
        return next((session for session in beside if session[0] == path), [path])
    found = sessions(path.glob("*.mcap"))
    if len(found) != 1:
        names = ", ".join(session[0].name for session in found) or "none"
        raise GatewayError(f"{path} is a directory with {len(found)} recordings: name one ({names})")
    return found[0]
