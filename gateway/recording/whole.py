"""Whole new recordings from records of others; nothing is ever written over, and nothing half done is left."""

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from gateway.errors import GatewayError
from gateway.recording.layout import FORMAT_KEY
from gateway.recording.writer import Recorder
from gateway.records import Record

BATCH = 256  # records, of up to 64 KiB each where files are imported


def write_whole(out: Path, metadata: Mapping[str, str], records: Iterable[Record]) -> int:
    """Write a recording with its index; how many records it holds. Raises GatewayError if it cannot be written."""
    if os.path.lexists(out):
        raise GatewayError(f"{out} is there already: name another file with -o")
    recorder = Recorder(out, {key: text for key, text in metadata.items() if key != FORMAT_KEY})
    batch: list[Record] = []
    try:
        for record in records:
            batch.append(record)
            if len(batch) == BATCH:
                recorder.append(batch)
                batch = []
        recorder.append(batch)
        recorder.close()
    except BaseException as error:
        recorder.abandon()
        with suppress(OSError):
            out.unlink()
        if isinstance(error, OSError):
            raise GatewayError(f"cannot write {out}: {error.strerror}; make room") from error
        raise
    return recorder.records
