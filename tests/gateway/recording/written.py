"""Recordings written from records made by hand."""

from pathlib import Path

from gateway.config import check_config
from gateway.metadata import describe
from gateway.recording import Recorder
from gateway.records import Record


def made(path: Path, records: list[Record], **changes: object) -> Path:
    rack = {"adapters": [{"name": "bridge", "source": "serial:x"}], **changes}
    recorder = Recorder(path, {**describe(check_config(rack, "test"), None), "boot": str(path)})
    recorder.append(records)
    recorder.close()
    return path
