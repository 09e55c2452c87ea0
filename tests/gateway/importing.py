"""Import files in this process, and read what came of them."""

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from gateway.events import Event, SummaryEvent
from gateway.imports.plan import Wish
from gateway.imports.run import import_files
from gateway.metadata import recorded_config, recorded_monitor
from gateway.recording import Recording
from gateway.records import Note, Record
from gateway.replay import replay
from simulators import arinc429
from tests.gateway.live import records
from tests.gateway.made import only


def imported(tmp_path: Path, layout: str, *contents: bytes, **wish: Any) -> Path:
    files = []
    for k, content in enumerate(contents):
        files.append(tmp_path / f"file{k}.bin")
        files[-1].write_bytes(content)
    out = tmp_path / "out.mcap"
    import_files(Wish(files, layout, **wish), out, passing)
    return out


def passing(items: Iterable[Record]) -> Iterator[Record]:
    return iter(items)


def events(path: Path) -> list[Event]:
    recording, found, failures = Recording(path), list[Event](), list[str]()
    config = recorded_config(recording.metadata)
    replay(recording, config, recorded_monitor(recording.metadata, config), found.append, failures.append)
    assert failures == []
    return found


def summary(path: Path) -> dict[str, int]:
    (last,) = only(SummaryEvent, events(path))
    return last.counters


def notes(path: Path) -> list[str]:
    return [record.text for record in records(path) if isinstance(record, Note)]


def pitch_word(degrees: float) -> bytes:
    return struct.pack("<I", arinc429.encode(0o324, degrees))
