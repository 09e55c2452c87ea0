"""A torn or damaged recording becomes a whole one that says what was lost."""

from collections.abc import Iterator
from pathlib import Path

from gateway.errors import GatewayError
from gateway.names import shown
from gateway.recording.session import Recording
from gateway.recording.whole import write_whole
from gateway.records import Note, Raw, Record


def recover(recording: Recording, records: Iterator[Record], out: Path) -> str:
    """Write what is whole to a new file, and last a note of what was lost; give that note.

    `records` are those of the recording. Raises GatewayError as `write_whole` does, and if none is whole.
    """
    said = [""]

    def with_note() -> Iterator[Record]:
        last: Record | None = None
        due, missing, again = recording.begins, 0, 0
        surely = -1  # the latest sequence of a raw record, which its CRC vouches for in every format
        for record in records:
            if record.sequence <= surely:
                again += 1
                continue
            missing += max(record.sequence - due, 0) if due is not None else 0
            last, due = record, record.sequence + 1
            surely = record.sequence if isinstance(record, Raw) else surely
            yield record
        if last is None:
            raise GatewayError(f"{recording.path} holds no whole record to recover: look for another copy")
        said[0] = _note(recording, missing, again)
        yield Note(last.sequence + 1, last.stamp, said[0])

    write_whole(out, {**recording.metadata, "recovered": f"from {shown(recording.path.name)}"}, with_note())
    return said[0]


def _note(recording: Recording, missing: int, again: int) -> str:
    lost = [
        f"{place.length} bytes at {place.offset} of {shown(place.path.name)}: {place.what}"
        for place in recording.damage
    ]
    if recording.damaged > len(lost):
        lost.append(f"{recording.damaged - len(lost)} more damaged places")
    if recording.torn:
        lost.append(shown(recording.torn))
    if missing:
        lost.append(f"{missing} records are missing before or between others")
    if again:
        lost.append(f"{again} records came again or too late and are left out")
    return f"recovered {recording.records - again} records from {shown(recording.path.name)}; " + (
        "; ".join(lost) or "nothing was lost"
    )
