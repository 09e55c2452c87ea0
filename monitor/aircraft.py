"""The aircraft's state from decoded ARINC 429 words: which label of which equipment gives which quantity, and when.

Position comes from the GNSS, whose coarse and fine words are joined only within one navigation epoch. Nothing stands in
for it silently: an inertial position steps by 19 m and drifts, so it is kept beside, never instead.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders.arinc429 import Status, Values429, join_position
from monitor.geodesy import FT_M, KT_M_S
from monitor.track import MISSING, NORMAL, STALE, Quantity, Track

EPOCH_NS = 40_000_000  # a set is sent in one burst, at low speed in 35 ms; the next comes 100 ms later or more

LATITUDE = Quantity("latitude_deg", 2.5, angle=True)
LONGITUDE = Quantity("longitude_deg", 2.5, angle=True)
HEIGHT = Quantity("height_m", 2.5)
PITCH = Quantity("pitch_deg", 0.25, angle=True)
ROLL = Quantity("roll_deg", 0.25, angle=True)
HEADING = Quantity("heading_deg", 0.25, angle=True)
GROUND_SPEED = Quantity("ground_speed_m_s", 0.5)
TRACK_ANGLE = Quantity("track_deg", 0.5, angle=True)
INERTIAL_LATITUDE = Quantity("inertial_latitude_deg", 1.0, angle=True)
INERTIAL_LONGITUDE = Quantity("inertial_longitude_deg", 1.0, angle=True)
INERTIAL_HEIGHT = Quantity("inertial_height_m", 0.5)
RADIO_HEIGHT = Quantity("radio_height_m", 0.5)
INTEGRITY_LIMIT = Quantity("horizontal_integrity_limit_nm", 2.5)


class Source(NamedTuple):
    """A label of an equipment (its low byte) that gives a quantity, times a factor to the quantity's unit."""

    equipment: int
    label: int
    quantity: Quantity
    factor: float = 1.0


SOURCES = (
    Source(0x0B, 0o076, HEIGHT, FT_M),
    Source(0x0B, 0o130, INTEGRITY_LIMIT),
    Source(0x04, 0o310, INERTIAL_LATITUDE),
    Source(0x04, 0o311, INERTIAL_LONGITUDE),
    Source(0x04, 0o312, GROUND_SPEED, KT_M_S),
    Source(0x04, 0o313, TRACK_ANGLE),
    Source(0x04, 0o314, HEADING),
    Source(0x04, 0o324, PITCH),
    Source(0x04, 0o325, ROLL),
    Source(0x04, 0o361, INERTIAL_HEIGHT, FT_M),
    Source(0x07, 0o164, RADIO_HEIGHT, FT_M),
)


class Axis(NamedTuple):
    """The coarse and fine labels of one coordinate of the GNSS."""

    equipment: int
    coarse: int
    fine: int
    quantity: Quantity


AXES = (Axis(0x0B, 0o110, 0o120, LATITUDE), Axis(0x0B, 0o111, 0o121, LONGITUDE))


@dataclass
class _Half:
    """The coarse or fine word that still waits for the other half of its epoch."""

    time_ns: int
    word: int
    status: int
    coarse: bool


def status_name(status: int) -> str:
    """The name of a status as it stands in reasons: a bus status, STALE or MISSING."""
    return {STALE: "STALE", MISSING: "MISSING"}.get(status) or Status(status).name


@dataclass
class Aircraft:
    """Tracks of every quantity, fed with decoded blocks."""

    tracks: dict[str, Track] = field(
        default_factory=lambda: {q.name: Track(q) for q in [s.quantity for s in SOURCES] + [a.quantity for a in AXES]}
    )
    _halves: dict[str, _Half] = field(default_factory=dict)

    def feed(self, equipment: int, time_ns: NDArray[np.int64], words: NDArray[np.uint32], values: Values429) -> None:
        """Take one decoded block of a channel (n,); `words` are in wire orientation."""
        for source in SOURCES:
            if source.equipment == equipment:
                at = values.label == source.label
                if at.any():
                    track = self.tracks[source.quantity.name]
                    track.append(time_ns[at], values.value[at] * source.factor, values.status[at])
        for axis in AXES:
            if axis.equipment == equipment:
                at = (values.label == axis.coarse) | (values.label == axis.fine)
                for k in np.flatnonzero(at):
                    coarse = bool(values.label[k] == axis.coarse)
                    self._join(axis, _Half(int(time_ns[k]), int(words[k]), int(values.status[k]), coarse))

    def _join(self, axis: Axis, half: _Half) -> None:
        other = self._halves.pop(axis.quantity.name, None)
        if other is None or other.coarse == half.coarse or abs(half.time_ns - other.time_ns) > EPOCH_NS:
            self._halves[axis.quantity.name] = half
            return
        coarse, fine = (half, other) if half.coarse else (other, half)
        status = max(coarse.status, fine.status)
        degrees = 0.0
        if status == NORMAL:
            joined = join_position(np.array([coarse.word], np.uint32), np.array([fine.word], np.uint32))
            degrees = float(joined[0])
        self.tracks[axis.quantity.name].append(
            np.array([coarse.time_ns]), np.array([degrees]), np.array([status], np.uint8)
        )
