"""Writes one recording file: an MCAP file, whole up to the last accepted write.

Messages are unchunked and each batch reaches the file in one `write()`, so a killed process loses nothing that was
accepted, and a power cut loses at most what was not yet synchronised. Any MCAP tool opens the file.
"""

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import Channel
from mcap.writer import Writer

from gateway.errors import GatewayError
from gateway.recording.layout import (
    FORMAT,
    LARGEST_RECORD,
    PROFILE,
    Topic,
    channel_entries,
    guarded,
    layout_of,
    payload,
    topic_of,
)
from gateway.records import Record

LONGEST_HEAD = 64  # bytes of a message and of a raw chunk before the chunk itself, at most


class _Sink:
    """What the MCAP writer writes to: gathers a batch, then hands it to the operating system in one call.

    It is no file of Python's, or the writer would put a buffer of its own before it that nobody flushes.
    """

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
        batch, self._batch = memoryview(self._batch), bytearray()
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

    def is_at(self, path: Path) -> bool:
        try:
            return os.path.samestat(os.fstat(self._file), path.stat())
        except OSError:
            return False

    def close(self) -> None:
        os.close(self._file)


class Recorder:
    """Writes one recording file; `append` returns once the operating system holds the records."""

    def __init__(self, path: Path, metadata: dict[str, str]) -> None:
        self.path = path
        self.records = 0
        self._named = False  # whether the disk was asked to hold the file's name
        self._topics: dict[str, tuple[int, int]] = {}  # channel, and what its CRCs begin with
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._sink = _Sink(path)
            self._begin(metadata)
        except OSError as error:
            raise GatewayError(f"cannot record to {path}: {error.strerror}; choose another directory") from error

    def _begin(self, metadata: dict[str, str]) -> None:
        """Write what every file begins with, or leave no file: an empty one would keep its name from the next try."""
        try:
            self._writer = Writer(self._sink, use_chunking=False)  # type: ignore[arg-type] # needs write and tell only
            self._writer.start(profile=PROFILE, library=PROFILE)
            self._metadata = guarded(PROFILE, metadata)
            for _ in range(2):  # a damaged byte spoils one of them
                self._writer.add_metadata(PROFILE, self._metadata)
            self._sink.commit()
        except BaseException:
            self._sink.close()
            with contextlib.suppress(OSError):
                self.path.unlink()
            raise

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._sink.accepted

    @property
    def there(self) -> bool:
        """Whether the file is still where it was made."""
        return self._sink.is_at(self.path)

    def append(self, records: Sequence[Record]) -> None:
        """Add records in order. Raises OSError if the disk does not take all of them; then none is in the file."""
        topics, add = self._topics, self._writer.add_message
        for record in records:
            name = topic_of(record)
            channel, seed = topics.get(name) or self._channel(name)
            data = payload(record, seed)
            if len(data) > LARGEST_RECORD - LONGEST_HEAD:
                raise ValueError(f"record {record.sequence} of {len(data)} bytes is larger than any record may be")
            utc_ns = record.stamp.utc_ns
            add(channel, utc_ns, data, utc_ns, record.sequence & 0xFFFFFFFF)
        self._sink.commit()
        self.records += len(records)

    def sync(self) -> None:
        """Ask the disk to hold what was appended, and at first the file's name too."""
        self._sink.sync()
        if not self._named:
            self._named = True
            with contextlib.suppress(OSError):  # not every file system can be asked that
                directory = os.open(self.path.parent, os.O_RDONLY | os.O_CLOEXEC)
                try:
                    os.fsync(directory)
                finally:
                    os.close(directory)

    def close(self) -> None:
        """Write the metadata once more, as the beginning may be lost, and the index; close. Neither need be there."""
        self._writer.add_metadata(PROFILE, self._metadata)
        self._writer.finish()  # type: ignore[no-untyped-call] # the library leaves it so
        self._sink.commit()
        self.sync()
        self._sink.close()

    def abandon(self) -> None:
        """Close without an index, on a disk that takes no more."""
        self._sink.close()

    def _channel(self, name: str) -> tuple[int, int]:
        number = len(self._topics) + 1
        encoding, entries = channel_entries(number, name)
        copy = RecordBuilder()
        Channel(id=number, topic=name, message_encoding=encoding, schema_id=0, metadata=entries).write(copy)
        self._sink.write(copy.end())  # type: ignore[no-untyped-call] # before the writer's own: a damaged byte spoils one of them
        self._writer.register_channel(name, encoding, 0, entries)
        self._topics[name] = number, Topic(name, layout_of({"format": FORMAT})).seed
        return self._topics[name]
