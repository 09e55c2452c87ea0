"""Events: what the gateway says, one JSON line each, the same bytes for the same recording."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Any, ClassVar


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


@dataclass(frozen=True)
class IntegrityEvent(Event):
    """The verdict on one scan."""

    type: ClassVar[str] = "integrity"
    scan: int
    method: str
    n_pairs: int
    scans: int
    t_bins2: float | None
    t_normalised: float | None
    q: float | None
    threshold: float | None
    p_fa: float
    mean_bins: float | None
    mean_stderr_bins: float | None
    shift: float | None
    shift_limit: float | None
    unmatched_radar: float | None
    unmatched_radar_limit: float | None
    unmatched_dem: float | None
    unmatched_dem_limit: float | None
    level: float | None
    mdb_bins: float | None
    calibration: str
    offset_north_m: float | None
    offset_east_m: float | None
    offset_confidence: float | None
    verdict: str
    reasons: tuple[str, ...]


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
