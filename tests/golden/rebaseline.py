"""Rewrites the golden events of every golden recording and prints what changed: `make rebaseline`."""

import difflib
from pathlib import Path

from gateway.metadata import recorded_config, recorded_monitor
from gateway.recording import Recording
from gateway.replay import replay
from tests.golden.make import HERE, TERRAIN

RECORDINGS = sorted(HERE.glob("*.mcap"))
TOP = HERE.parent.parent


def golden(recording: Path) -> Path:
    """Where the events of a golden recording are kept."""
    return recording.with_suffix(".jsonl")


def events(path: Path) -> str:
    """The JSON lines that a recording replays to."""
    recording = Recording(path)
    config = recorded_config(recording.metadata)
    lines: list[str] = []
    failures: list[str] = []
    monitor = recorded_monitor(recording.metadata, config, (TOP / TERRAIN,))
    replay(recording, config, monitor, lambda event: lines.append(event.to_json() + "\n"), failures.append)
    assert failures == []
    return "".join(lines)


def main() -> None:
    for path in RECORDINGS:
        kept = golden(path)
        before = kept.read_text() if kept.exists() else ""
        kept.write_text(after := events(path))
        diff = difflib.unified_diff(
            before.splitlines(True), after.splitlines(True), f"{kept.name} before", "after", n=0
        )
        print("".join(diff) or f"{kept.name}: unchanged")  # noqa: T201 # what the command is for


if __name__ == "__main__":
    main()
