"""The recording: an MCAP file of raw chunks, statuses, ticks and notes, whole up to the last accepted write.

Messages are unchunked and each batch reaches the file in one `write()`, so a killed process loses nothing that was
accepted, and a power cut loses at most what was not yet synchronised. Any MCAP tool opens the file.
"""

import os
import struct
from collections.abc import Iterator, Sequence
from io import BufferedReader
from pathlib import Path

from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from gateway.errors import GatewayError
from gateway.records import (
    RAW_LAYOUT,
    DamagedRecord,
    Note,
    Raw,
    Record,
    Status,
    Tick,
    json_payload,
    parse_json,
    parse_raw,
    raw_payload,
)

PROFILE = "shadebus"
LARGEST_RECORD = 16 << 20  # far above any chunk: a torn length must not ask for gigabytes
TORN = (McapError, struct.error, ValueError, EOFError)  # what the MCAP reader raises where a file is torn
TOPICS: dict[str, type[Status] | type[Tick] | type[Note]] = {"/status": Status, "/tick": Tick, "/note": Note}


class _Sink:
    """What the MCAP writer writes to: gathers a batch, then hands it to the operating system in one call."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._batch = bytearray()
        self.accepted = 0  # bytes for which write() has returned

    def write(self, data: bytes) -> int:
        self._batch += data
        return len(data)

    def flush(self) -> None:
        """The writer's own flushes wait for `commit`."""

    def tell(self) -> int:
        return self.accepted + len(self._batch)

    def commit(self) -> None:
        """Write the batch; if the disk takes only a part of it, take that part back and raise OSError."""
        batch, self._batch = memoryview(bytes(self._batch)), bytearray()
        written = 0
        try:
            while written < len(batch):
                written += os.write(self._file, batch[written:])
        except OSError:
            os.ftruncate(self._file, self.accepted)
            os.lseek(self._file, self.accepted, os.SEEK_SET)
            raise
        self.accepted += written

    def sync(self) -> None:
        os.fdatasync(self._file)

    def close(self) -> None:
        os.close(self._file)


class Recorder:
    """Writes one recording file; `append` returns once the operating system holds the records."""

    def __init__(self, path: Path, metadata: dict[str, str]) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._sink = _Sink(path)
            self._writer = Writer(self._sink, use_chunking=False)  # type: ignore[arg-type] # needs write and tell only
            self._channels: dict[str, int] = {}
            self._writer.start(profile=PROFILE, library="shadebus")
            self._writer.add_metadata("shadebus", metadata)
            self._sink.commit()
        except OSError as error:
            raise GatewayError(f"cannot record to {path}: {error.strerror}; choose another directory") from error

    def append(self, records: Sequence[Record]) -> None:
        """Add records in order. Raises OSError if the disk does not take all of them; then none is in the file."""
        for record in records:
            if isinstance(record, Raw):
                channel, payload = self._channel(f"/raw/{record.adapter}", "x-shadebus-raw"), raw_payload(record)
            else:
                channel = self._channel(f"/{type(record).__name__.lower()}", "json")
                payload = json_payload(record)
            stamp = record.stamp
            self._writer.add_message(channel, stamp.utc_ns, payload, stamp.utc_ns, record.sequence & 0xFFFFFFFF)
        self._sink.commit()

    def sync(self) -> None:
        """Ask the disk to hold what was appended."""
        self._sink.sync()

    def close(self) -> None:
        """Write the index and close. A file without it stays readable."""
        self._writer.finish()  # type: ignore[no-untyped-call] # the library leaves it so
        self._sink.commit()
        self._sink.sync()
        self._sink.close()

    def abandon(self) -> None:
        """Close without an index, on a disk that takes no more."""
        self._sink.close()

    def _channel(self, topic: str, encoding: str) -> int:
        if topic not in self._channels:
            layout = {"layout": RAW_LAYOUT} if encoding == "x-shadebus-raw" else {}
            self._channels[topic] = self._writer.register_channel(topic, encoding, 0, layout)
        return self._channels[topic]


class Recording:
    """A recording to read: `metadata`, and an iterator over its records in the order they were accepted.

    A torn tail ends an iteration and is described in `torn`; a damaged record is skipped and counted in `damaged`.
    Raises GatewayError for a file that is missing or is no recording of ours.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, str] = {}
        self.records = 0
        self.damaged = 0
        self.torn = ""
        with self._open() as file:
            items = StreamReader(file, record_size_limit=LARGEST_RECORD).records
            try:
                if getattr(next(items), "profile", None) != PROFILE:
                    raise GatewayError(f"{path} is an MCAP file, but not a shadebus recording")
                self.metadata = getattr(next(items, None), "metadata", {})
            except (*TORN, StopIteration) as error:
                why = str(error) if isinstance(error, InvalidMagic) else "it ends before its first record"
                raise GatewayError(f"{path} is not a shadebus recording: {why}; look for another copy") from error

    def __iter__(self) -> Iterator[Record]:
        self.records, self.damaged, self.torn = 0, 0, ""
        topics: dict[int, str] = {}
        with self._open() as file:
            items = StreamReader(file, record_size_limit=LARGEST_RECORD).records
            while True:
                try:
                    item = next(items)
                except StopIteration:  # behind the closing magic
                    return
                except TORN as error:
                    self.torn = f"the file ends without its index after {self.records} records ({type(error).__name__})"
                    return
                if isinstance(item, Channel):
                    topics[item.id] = item.topic
                elif isinstance(item, Message):
                    try:
                        record = _record(topics.get(item.channel_id, ""), item.data)
                    except DamagedRecord:
                        self.damaged += 1
                    else:
                        self.records += 1
                        yield record

    def _open(self) -> BufferedReader:
        try:
            return self.path.open("rb")
        except OSError as error:
            raise GatewayError(f"cannot read recording {self.path}: {error.strerror}") from error


def _record(topic: str, payload: bytes) -> Record:
    if topic.startswith("/raw/"):
        return parse_raw(topic.removeprefix("/raw/"), payload)
    if topic in TOPICS:
        return parse_json(TOPICS[topic], payload)
    raise DamagedRecord(f"unknown topic {topic!r}")
