"""A part of a recording as a recording of its own."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from gateway.errors import GatewayError
from gateway.names import shown
from gateway.recording.session import Recording
from gateway.recording.whole import write_whole
from gateway.records import Record

LONGEST_S = 1e10  # three hundred years: no recording is as long, and in ns it is far from overflow


def moment(text: str) -> float | datetime:
    """Seconds from the first record, or a UTC. Raises GatewayError for what is neither."""
    with suppress(ValueError):
        seconds = float(text)
        if abs(seconds) <= LONGEST_S:
            return seconds
    try:
        when = datetime.fromisoformat(text)
        return when.astimezone(UTC) if when.tzinfo else when.replace(tzinfo=UTC)
    except (ValueError, OverflowError) as error:
        raise GatewayError(f"{text!r} is no time: write seconds, or UTC as 2026-05-28T20:26:41.5") from error


def in_order(start: float | datetime | None, stop: float | datetime | None) -> None:
    """Raise GatewayError for a stop that does not come after the start, where the two can be compared."""
    if start is None or stop is None or isinstance(start, datetime) != isinstance(stop, datetime):
        return
    if stop <= start:  # type: ignore[operator] # both are of one kind
        raise GatewayError(f"--stop {stop} does not come after --start {start}: give a later --stop")


def cut(
    recording: Recording,
    records: Iterable[Record],
    start: float | datetime | None,
    stop: float | datetime | None,
    out: Path,
) -> int:
    """Write the records from `start` up to `stop` to a new file, with their own sequences; how many there are.

    Raises GatewayError as `write_whole` does, if `stop` does not come after `start`, and if none lies between.
    """
    in_order(start, stop)
    about = f"from {'the beginning' if start is None else start} to {'the end' if stop is None else stop}"
    metadata = {**recording.metadata, "cut": f"{about} of {shown(recording.path.name)}"}

    def some() -> Iterator[Record]:
        within = False
        for record in between(records, start, stop):
            within = True
            yield record
        if not within:
            raise GatewayError(f"{recording.path} has nothing {about}: `shadebus info` tells its times")

    return write_whole(out, metadata, some())


def between(
    records: Iterable[Record], start: float | datetime | None, stop: float | datetime | None
) -> Iterator[Record]:
    """The records of a time: seconds count on the monotonic clock from the first record, UTC as it was recorded."""
    first_ns: int | None = None
    for record in records:
        first_ns = record.stamp.monotonic_ns if first_ns is None else first_ns
        if start is not None and _since_ns(record, start, first_ns) < 0:
            continue
        if stop is not None and _since_ns(record, stop, first_ns) > 0:
            if isinstance(stop, float):
                return
            continue  # UTC may yet be stepped back
        yield record


def _since_ns(record: Record, when: float | datetime, first_ns: int) -> int:
    if isinstance(when, datetime):
        return record.stamp.utc_ns - round(when.timestamp() * 1e6) * 1000
    return record.stamp.monotonic_ns - first_ns - round(when * 1e9)
