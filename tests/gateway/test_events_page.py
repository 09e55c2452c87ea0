"""The page of events has every field that an event has, and no other."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from gateway.events import Event, IntegrityEvent, ScanEvent, StateEvent, StatusEvent, SummaryEvent

PAGE = (Path(__file__).parents[2] / "docs" / "events.md").read_text()


def described(section: str) -> list[str]:
    cells = re.findall(r"^\| (`.*?) \|", section, re.MULTILINE)
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


@pytest.mark.parametrize("event", [StatusEvent, ScanEvent, StateEvent, IntegrityEvent, SummaryEvent])
def test_every_field_of_an_event_is_described(event: type[Event]) -> None:
    common, *sections = PAGE.split("\n## ")
    (section,) = (text for text in sections if text.startswith(f"{event.type}\n"))
    names = described(common) + described(section)
    assert sorted(names) == sorted(["type", *(field.name for field in fields(event))])
