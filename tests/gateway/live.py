"""The gateway in this process, and its recording replayed: both must say the same, byte for byte."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event
from types import TracebackType
from typing import Any, Self

from gateway.config import RackConfig
from gateway.metadata import build_monitor, recorded_config, recorded_monitor
from gateway.recording import Recording
from gateway.records import Raw, Record
from gateway.replay import replay
from gateway.service import Service

DEADLINE_S = 15.0
POLL_S = 0.01


def wait_until(condition: Callable[[], object], what: str) -> None:
    """Return as soon as the condition holds; fail after the deadline."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline, f"{what}: not within {DEADLINE_S:.0f} s"
        Event().wait(POLL_S)


def replayed(path: Path) -> list[str]:
    """The JSON lines that a recording replays to, with the monitor that it was made with."""
    recording = Recording(path)
    config = recorded_config(recording.metadata)
    lines: list[str] = []
    failures: list[str] = []
    monitor = recorded_monitor(recording.metadata, config)
    replay(recording, config, monitor, lambda event: lines.append(event.to_json()), failures.append)
    assert failures == []
    return lines


def recorded_bytes(path: Path, adapter: str = "bridge") -> bytes:
    """Everything that an adapter delivered, as the recording holds it."""
    return b"".join(record.data for record in raw_records(path) if record.adapter == adapter)


def raw_records(path: Path) -> list[Raw]:
    """The raw records of a recording."""
    return [record for record in records(path) if isinstance(record, Raw)]


def records(path: Path) -> list[Record]:
    """All records of a recording."""
    return list(Recording(path))


class Live:
    """A service that runs inside a `with` block; leaving it stops the service and compares the replay with it."""

    def __init__(self, config: RackConfig) -> None:
        self.lines: list[str] = []
        self.service = Service(config, build_monitor(config), lambda event: self.lines.append(event.to_json()))

    @property
    def path(self) -> Path:
        """The recording."""
        assert self.service.recording_path is not None
        return self.service.recording_path

    def events(self, kind: str, **fields: object) -> list[dict[str, Any]]:
        """The events so far of a type, and with these fields."""
        events = [json.loads(line) for line in list(self.lines)]
        return [event for event in events if event["type"] == kind and fields.items() <= event.items()]

    def wait_for(self, kind: str, count: int = 1, **fields: object) -> None:
        """Wait until so many of these events have come."""
        wait_until(lambda: len(self.events(kind, **fields)) >= count, f"{count} times {kind} {fields}")

    def wait_for_bytes(self, count: int) -> None:
        """Wait until the recording holds so many bytes of the bridge."""
        wait_until(lambda: len(recorded_bytes(self.path)) >= count, f"{count} bytes recorded")

    def __enter__(self) -> Self:
        self.service.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.service.stop()
        if kind is None:
            assert replayed(self.path) == self.lines
