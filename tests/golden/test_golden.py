"""What was recorded once replays to the same events for ever, whatever the format was then."""

from pathlib import Path

import pytest

from tests.golden.rebaseline import RECORDINGS, events, golden


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_a_golden_recording_replays_to_its_golden_events(path: Path) -> None:
    assert events(path) == golden(path).read_text()


def test_there_are_golden_recordings() -> None:
    assert {path.stem for path in RECORDINGS} >= {"format1", "format2", "format2_torn"}
