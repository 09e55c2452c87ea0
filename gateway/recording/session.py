"""A recording to read: one file, or the files of a rotated session as if they were one."""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from gateway.chunks import SEQUENCE, Chunks, Run
from gateway.errors import GatewayError
from gateway.recording import index
from gateway.recording.layout import FORMAT_KEY, LAYOUTS, MAGIC
from gateway.recording.reader import OPENING, Damage, FileReader, Findings
from gateway.recording.window import Window
from gateway.records import Record

FOR_METADATA = 1 << 20  # of the beginning of a file
WRITTEN_BY_COMMANDS = {"cut", "merged", "recovered"}  # metadata of files that no session has
_FOLLOWER = re.compile(r"(.+)\.(\d{4,})")


def file_of_session(first: Path, number: int) -> Path:
    """The path of a session's file by its number, which counts from 1."""
    return first if number == 1 else first.with_name(f"{first.stem}.{number:04d}{first.suffix}")


class Recording:
    """A recording: its `metadata`, and an iterator over its records in the order they were accepted.

    A file that begins a session stands for all of it, and a directory for the only session in it; a list of files is
    read as it is. An iteration tells how many `records` were whole, how many places were `damaged`, the first of them
    in `damage`, how many records are `missing`, all `losses` in words, and in `torn` of each file that does not end as
    it should. Raises GatewayError for what is missing or is no recording of ours.
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
    def missing(self) -> int:
        """Records that the sequences of the last iteration say there were, and that did not come."""
        return self._found.missing

    @property
    def losses(self) -> list[str]:
        """What the last iteration found damaged, missing or out of order before the end, in words."""
        found = self._found
        counted = (
            (found.damaged, "damaged place", "damaged places"),
            (found.missing, "missing record", "missing records"),
            (found.back, "step back in the order", "steps back in the order"),
        )
        return [f"{count} {what if count == 1 else plural}" for count, what, plural in counted if count]

    @property
    def complaints(self) -> list[str]:
        """The losses and the torn ends, in words."""
        return [*self.losses, *([self.torn] if self.torn else [])]

    @property
    def begins(self) -> int | None:
        """The sequence of the first record; None of what need not begin where a session does."""
        whole = self.path.is_dir() or self.metadata.get("file", "1") == "1"
        return 0 if whole and "cut" not in self.metadata else None

    @property
    def torn(self) -> str:
        """What is to be said of files without their index."""
        return "; ".join(f"{path.name}: {text}" if len(self.files) > 1 else text for path, text in self._found.torn)

    def runs(self) -> Iterator[Run]:
        """The same records in runs, raw ones as columns."""
        self._found = found = Findings()
        return _in_order(chain.from_iterable(_runs(path, found) for path in self.files), found, self.begins)

    def __iter__(self) -> Iterator[Record]:
        return chain.from_iterable(self.runs())


def read_file(path: Path, found: Findings) -> Iterator[Record]:
    """The records of one file, which need not even be a recording: then all of it is damaged, or torn."""
    return chain.from_iterable(_runs(path, found))


def _runs(path: Path, found: Findings) -> Iterator[Run]:
    with Window(path) as window:
        yield from FileReader(path, window, found).runs()


def _in_order(runs: Iterable[Run], found: Findings, due: int | None) -> Iterator[Run]:
    """The runs; to the findings goes whether their sequences count on, from the one that is due if that is known."""
    for run in runs:
        yield run
        if isinstance(run, Chunks):
            sequence = run.columns[SEQUENCE, : run.given].astype(np.int64)
        else:
            sequence = np.array([record.sequence for record in run], np.uint64).astype(np.int64)
        if not len(sequence):
            continue
        due = int(sequence[0]) if due is None else due
        if not np.array_equal(sequence, np.arange(due, due + len(sequence))):
            steps = np.diff(sequence, prepend=due - 1)
            found.missing += int(np.maximum(steps - 1, 0).sum())
            found.back += int(np.count_nonzero(steps < 1))
        due = int(sequence[-1]) + 1


def metadata_of(path: Path) -> dict[str, str]:
    """What a file says of itself. Raises GatewayError if it is no recording, or of a format that we do not know."""
    with Window(path) as window:
        window.end = min(window.end, FOR_METADATA)
        opening = window.get(0, len(OPENING))
        reader = FileReader(path, window, Findings())
        next(reader.records(), None)
        metadata = reader.metadata or index.metadata(window)
    if not metadata and opening != OPENING:
        if window.size < len(OPENING):
            raise GatewayError(f"{path} is not a shadebus recording: it ends before its first record")
        if opening.startswith(MAGIC):
            raise GatewayError(f"{path} is an MCAP file, but not a shadebus recording")
        why = "it does not begin as an MCAP file, and no index says more; look for another copy"
        raise GatewayError(f"{path} is not a shadebus recording: {why}")
    version = metadata.get(FORMAT_KEY, "1")
    if version not in LAYOUTS:
        raise GatewayError(f"{path} is of format {version}, which a later version of shadebus wrote: update shadebus")
    return metadata


def sessions(files: Iterable[Path]) -> list[list[Path]]:
    """Files by the session that they belong to, each session's in order, whether it is all there.

    Names say it, and of a file that follows another its metadata too, if that can be read.
    """
    found: dict[Path, list[tuple[int, Path]]] = {}
    for file in files:
        match = _FOLLOWER.fullmatch(file.stem)
        first = file.with_name(f"{match[1]}{file.suffix}") if match else file
        found.setdefault(first, []).append((int(match[2]) if match else 1, file))
    every = []
    for _, group in sorted(found.items()):
        first, *rest = (file for _, file in sorted(group))
        strange = [file for file in rest if not _follows(file, first)]
        every += [[first, *(file for file in rest if file not in strange)], *([file] for file in strange)]
    return every


def _follows(file: Path, first: Path) -> bool:
    """Whether a file named like one that follows another is of its session; True if that cannot be read."""
    try:
        here, there = metadata_of(file), metadata_of(first)
    except GatewayError:
        return True
    return here.get("session") == there.get("session") and not here.keys() & WRITTEN_BY_COMMANDS


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
