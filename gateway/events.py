"""Events: what the gateway says, one JSON line each, the same bytes for the same recording."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from monitor.verdict import Verdict


@dataclass(frozen=True)
class Event:
    """What every event carries: UTC in ns and the sequence of the record it came from."""

    type: ClassVar[str]
    time_ns: int
    sequence: int

    def to_json(self) -> str:
        """One line; numbers that JSON has no word for become null."""
        fields = {"type": self.type, **asdict(self)}
        return json.dumps(_plain(fields), separators=(",", ":"), allow_nan=False)


@dataclass(frozen=True)
class StatusEvent(Event):
    """An adapter or a part of the gateway changed its state."""

    type: ClassVar[str] = "status"
    adapter: str
    state: str
    reason: str


@dataclass(frozen=True)
class ScanEvent(Event):
    """A sweep of the antenna is complete."""

    type: ClassVar[str] = "scan"
    scan: int
    radials: int
    sector: tuple[float, float]  # smallest and largest scan angle, degrees
    range_nm: float
    tilt_deg: float
    gaps: int
    repeated: int
    cut_off: int  # at its ends, against the sweep before


@dataclass(frozen=True)
class StateEvent(Event):
    """The aircraft's state: each quantity brought to the event's time, its validity, and its newest sample's age."""

    type: ClassVar[str] = "state"
    values: dict[str, float | None]
    validity: dict[str, str]
    age_s: dict[str, float | None]


@dataclass(frozen=True, kw_only=True)
class IntegrityEvent(Verdict, Event):
    """The verdict on one scan, and by which method and at which probability of a false alert it was found."""

    type: ClassVar[str] = "integrity"
    method: str
    p_fa: float


@dataclass(frozen=True)
class SummaryEvent(Event):
    """Every counter, at the end."""

    type: ClassVar[str] = "summary"
    counters: dict[str, int]


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
