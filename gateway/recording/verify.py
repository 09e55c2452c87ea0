"""Whether a recording is sound: every CRC, every sequence, every gap between records and files, every index."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from gateway.errors import GatewayError
from gateway.recording.keeper import NAME
from gateway.recording.reader import Findings
from gateway.recording.session import WRITTEN_BY_COMMANDS, Recording, metadata_of, read_file
from gateway.records import Note, Record, Status

KEPT = 100  # of the problems; the others are counted
BACK_NS = 1_000_000_000  # two adapters may be stamped in one order and queued in the other, but not this far apart


@dataclass
class Soundness:
    """What was found: problems, kept up to a bound and counted, and what the recording says of itself."""

    records: int = 0
    count: int = 0
    missing: int = 0  # sequences
    problems: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    _last: Record | None = None

    @property
    def lacks_its_end(self) -> bool:
        """Whether the last record is another one than a gateway writes when it ends."""
        last = self._last
        return not (isinstance(last, Status) and (last.adapter, last.state) == (NAME, "CLOSED"))

    def problem(self, text: str) -> None:
        """Count what is wrong."""
        self.count += 1
        if len(self.problems) < KEPT:
            self.problems.append(text)

    def feed(self, record: Record, path: Path, first: int | None) -> None:
        """Look at the next record, whose sequence must be the next one; that of the very first is `first`, if known."""
        due = self._last.sequence + 1 if self._last else first
        self.records += 1
        if due is not None and record.sequence > due:
            self.missing += record.sequence - due
            self.problem(f"{path}: records {due} to {record.sequence - 1} are missing")
        elif due is not None and record.sequence < due:
            self.problem(f"{path}: record {record.sequence} comes where {due} is due")
        if self._last and record.stamp.monotonic_ns < self._last.stamp.monotonic_ns - BACK_NS:
            self.problem(f"{path}: the time of record {record.sequence} lies before that of the record before it")
        if (text := _remark(record)) and len(self.remarks) < KEPT:
            self.remarks.append(f"record {record.sequence} says: {text}")
        self._last = record


def _remark(record: Record) -> str:
    """What a recording says of itself: steps of UTC, and how its disk did."""
    if isinstance(record, Note):
        return record.text
    if isinstance(record, Status) and record.adapter == NAME:
        return f"{record.adapter} {record.state}: {record.reason}"
    return ""


def verify(recording: Recording, until: Callable[[Iterable[Record]], Iterable[Record]] = iter) -> Soundness:
    """Look at every record; `until` wraps what is iterated over, for whoever wants to end it early."""
    found = Soundness()
    for place, path in enumerate(recording.files):
        for text in _numbering(recording, place):
            found.problem(text)
        first = None if place else recording.begins
        read = Findings()
        for record in until(read_file(path, read)):
            found.feed(record, path, first)
        for damage in read.places:
            found.problem(f"{damage.path}: {damage.length} bytes from {damage.offset} on are damaged: {damage.what}")
        found.count += read.damaged - len(read.places)
        for _, text in read.torn:
            found.problem(f"{path}: {text}")
        if not read.torn and not read.damaged and (text := _index(path, read.records)):
            found.problem(f"{path}: {text}")
    if found.lacks_its_end and "session" in recording.metadata and not recording.metadata.keys() & WRITTEN_BY_COMMANDS:
        found.remarks.append("the session does not end here: its last record is none of its closing")
    return found


def _numbering(recording: Recording, place: int) -> Iterator[str]:
    """What is wrong with the place of a file in its session."""
    if place == 0:
        return
    path = recording.files[place]
    try:
        before, here = metadata_of(recording.files[place - 1]), metadata_of(path)
    except GatewayError:
        return  # which reading it tells too
    if before.get("session") != here.get("session"):
        yield f"{path}: it belongs to another session than the file before it"
    elif here.get("file") != str(int(before.get("file", 0)) + 1):
        yield f"{path}: it is file {here.get('file')} of its session and follows file {before.get('file')}"


def _index(path: Path, records: int) -> str:
    """What the index of a closed file says that is not so, as the MCAP library reads it."""
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except (McapError, ValueError) as error:
        return f"its index cannot be read: {error}"
    counted = summary.statistics.message_count if summary and summary.statistics else 0
    return "" if counted == records else f"its index says {counted} records, and there are {records}"
