"""The aircraft's state from decoded ARINC 429 words: which label of which equipment gives which quantity, and when.

Position comes from the GNSS, whose coarse and fine words are joined only within one navigation epoch. Nothing stands in
for it silently: an inertial position steps by 19 m and drifts, so it is kept beside, never instead. Two sources of one
quantity are never mixed either, be they two kinds of equipment or two SDIs on one bus: the first is used until it falls
silent.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429
from decoders.arinc429 import JoinRule, Status, Values429
from decoders.definitions import Definitions
from monitor import geoid
from monitor.geodesy import FT_M, KT_M_S, NM_M
from monitor.join_check import JoinCheck
from monitor.settings import HeightSource
from monitor.track import MISSING, NORMAL, STALE, Quantity, Track
from monitor.utc import UTC_LABELS, UtcClock

EPOCH_NS = 40_000_000  # a set is sent in one burst, at low speed in 35 ms
SILENT_NS = 2_500_000_000  # of a source; nothing is interpolated over so long a gap, so another can follow it
G_M_S2: Final = 9.80665
SI: Final = {
    "": 1.0, "deg": 1.0, "deg/s": 1.0, "m": 1.0, "ft": FT_M, "NM": NM_M, "kt": KT_M_S, "ft/min": FT_M / 60, "g": G_M_S2,
}  # fmt: skip # degrees stay degrees

LATITUDE = Quantity("latitude_deg", 2.5, angle=True)
LONGITUDE = Quantity("longitude_deg", 2.5, angle=True)
HEIGHT = Quantity("height_m", 2.5)
ELLIPSOID_HEIGHT = Quantity("ellipsoid_height_m", 2.5)
GNSS_MODE = Quantity("gnss_mode", 2.5, step=True)
SATELLITE_FAILURE = Quantity("gnss_satellite_failure", 2.5, step=True)
INTEGRITY_LIMIT = Quantity("horizontal_integrity_limit_m", 2.5, step=True)
HORIZONTAL_MERIT = Quantity("horizontal_figure_of_merit_m", 2.5, step=True)
VERTICAL_MERIT = Quantity("vertical_figure_of_merit_m", 2.5, step=True)
GNSS_SPEED = Quantity("gnss_ground_speed_m_s", 2.5)
GNSS_TRACK = Quantity("gnss_track_deg", 2.5, angle=True)
GNSS_NORTH = Quantity("gnss_north_velocity_m_s", 2.5)
GNSS_EAST = Quantity("gnss_east_velocity_m_s", 2.5)
GNSS_UP = Quantity("gnss_up_velocity_m_s", 2.5)
PITCH = Quantity("pitch_deg", 0.25, angle=True)
ROLL = Quantity("roll_deg", 0.25, angle=True)
HEADING = Quantity("heading_deg", 0.25, angle=True)
MAGNETIC_HEADING = Quantity("magnetic_heading_deg", 0.25, angle=True)
DRIFT = Quantity("drift_deg", 0.5, angle=True)
GROUND_SPEED = Quantity("ground_speed_m_s", 0.5)
TRACK_ANGLE = Quantity("track_deg", 0.5, angle=True)
NORTH = Quantity("north_velocity_m_s", 0.5)
EAST = Quantity("east_velocity_m_s", 0.5)
UP = Quantity("up_velocity_m_s", 0.5)
INERTIAL_LATITUDE = Quantity("inertial_latitude_deg", 1.0, angle=True)
INERTIAL_LONGITUDE = Quantity("inertial_longitude_deg", 1.0, angle=True)
INERTIAL_HEIGHT = Quantity("inertial_height_m", 0.5)
HYBRID_LATITUDE = Quantity("hybrid_latitude_deg", 1.0, angle=True)
HYBRID_LONGITUDE = Quantity("hybrid_longitude_deg", 1.0, angle=True)
HYBRID_HEIGHT = Quantity("hybrid_height_m", 0.5)
PRESSURE_ALTITUDE = Quantity("pressure_altitude_m", 0.5)
BARO_ALTITUDE = Quantity("baro_altitude_m", 0.5)
TRUE_AIRSPEED = Quantity("true_airspeed_m_s", 0.5)
RADIO_HEIGHT = Quantity("radio_height_m", 0.5)

GNSS, INERTIAL, HYBRID, AIR_DATA, RADIO = (0x0B,), (0x04, 0x05, 0x38), (0x38,), (0x06,), (0x07,)  # low byte of the id


class Source(NamedTuple):
    """A label of some equipment that gives a quantity, as its value or as discrete bits of it."""

    equipment: tuple[int, ...]
    label: int
    quantity: Quantity
    bits: str = ""


SOURCES = (
    Source(GNSS, 0o076, HEIGHT),
    Source(GNSS, 0o370, ELLIPSOID_HEIGHT),
    Source(GNSS, 0o103, GNSS_TRACK),
    Source(GNSS, 0o112, GNSS_SPEED),
    Source(GNSS, 0o130, INTEGRITY_LIMIT),
    Source(GNSS, 0o130, SATELLITE_FAILURE, "satellite_failure"),
    Source(GNSS, 0o136, VERTICAL_MERIT),
    Source(GNSS, 0o165, GNSS_UP),
    Source(GNSS, 0o166, GNSS_NORTH),
    Source(GNSS, 0o174, GNSS_EAST),
    Source(GNSS, 0o247, HORIZONTAL_MERIT),
    Source(GNSS, 0o273, GNSS_MODE, "mode"),
    Source(INERTIAL, 0o310, INERTIAL_LATITUDE),
    Source(INERTIAL, 0o311, INERTIAL_LONGITUDE),
    Source(INERTIAL, 0o312, GROUND_SPEED),
    Source(INERTIAL, 0o313, TRACK_ANGLE),
    Source(INERTIAL, 0o314, HEADING),
    Source(INERTIAL, 0o320, MAGNETIC_HEADING),
    Source(INERTIAL, 0o321, DRIFT),
    Source(INERTIAL, 0o324, PITCH),
    Source(INERTIAL, 0o325, ROLL),
    Source(INERTIAL, 0o361, INERTIAL_HEIGHT),
    Source(INERTIAL, 0o365, UP),
    Source(INERTIAL, 0o366, NORTH),
    Source(INERTIAL, 0o367, EAST),
    Source(HYBRID, 0o261, HYBRID_HEIGHT),
    Source(AIR_DATA, 0o203, PRESSURE_ALTITUDE),
    Source(AIR_DATA, 0o204, BARO_ALTITUDE),
    Source(AIR_DATA, 0o210, TRUE_AIRSPEED),
    Source(RADIO, 0o164, RADIO_HEIGHT),
)


class Axis(NamedTuple):
    """The coarse and fine labels of one coordinate."""

    equipment: tuple[int, ...]
    coarse: int
    fine: int
    quantity: Quantity


AXES = (
    Axis(GNSS, 0o110, 0o120, LATITUDE),
    Axis(GNSS, 0o111, 0o121, LONGITUDE),
    Axis(HYBRID, 0o254, 0o256, HYBRID_LATITUDE),
    Axis(HYBRID, 0o255, 0o257, HYBRID_LONGITUDE),
)
SOURCES_OF: Final = {
    (equipment, source.label): [row for row in SOURCES if equipment in row.equipment and row.label == source.label]
    for source in SOURCES
    for equipment in source.equipment
}
AXIS_OF: Final = {(equipment, label): axis for axis in AXES for equipment in axis.equipment for label in axis[1:3]}
QUANTITIES = tuple({row.quantity.name: row.quantity for row in (*SOURCES, *AXES)}.values())


@dataclass
class _Half:
    """A coarse or fine word, which waits for the other half of its epoch."""

    time_ns: int
    word: int
    status: int
    coarse: bool


@cache
def _has_sdi(definitions: Definitions) -> NDArray[np.bool_]:
    """By label (256,), whether bits 9 and 10 of its words name their source."""
    return np.isin(np.arange(256), [label for label, row in definitions.labels.items() if row.has_sdi])


@cache
def _one_by_one(equipment: int) -> NDArray[np.bool_]:
    """By label (256,), whether its words are taken in their order: halves of positions, and parts of UTC."""
    return np.array(
        [(equipment, label) in AXIS_OF or (equipment in GNSS and label in UTC_LABELS) for label in range(256)]
    )


@cache
def _used(equipment: int) -> NDArray[np.bool_]:
    """By label (256,), whether anything is made of its words."""
    return np.array([(equipment, label) in SOURCES_OF or _one_by_one(equipment)[label] for label in range(256)])


def _epoch_ns(definitions: Definitions, axis: Axis) -> int:
    """How far apart the words of one epoch may be: less than half the time to the next epoch."""
    definition = definitions.labels.get(axis.coarse)
    shortest_ms = definition.interval_ms[0] if definition and definition.interval_ms else math.inf
    return min(EPOCH_NS, round(min(shortest_ms, 1000.0) * 1e6 / 2))


def status_name(status: int) -> str:
    """The name of a status as it stands in reasons: a bus status, STALE or MISSING."""
    return {STALE: "STALE", MISSING: "MISSING"}.get(status) or Status(status).name


@dataclass
class Aircraft:
    """Tracks of every quantity, fed with decoded blocks; heights are above mean sea level, metres.

    `height_source` "370" makes the height from the GNSS height above the ellipsoid and the EGM96 geoid.
    """

    height_source: HeightSource = "076"
    tracks: dict[str, Track] = field(default_factory=lambda: {q.name: Track(q) for q in QUANTITIES})
    utc: UtcClock = field(default_factory=UtcClock)
    _owners: dict[str, int] = field(default_factory=dict)
    _sources: dict[int, tuple[int, int]] = field(default_factory=dict)  # equipment -> SDI in use, when last heard
    _strange: dict[str, str] = field(default_factory=dict)
    _halves: dict[str, _Half] = field(default_factory=dict)
    _joins: Mapping[str, JoinCheck] = field(default_factory=lambda: {axis.quantity.name: JoinCheck() for axis in AXES})

    def feed(
        self,
        definitions: Definitions,
        time_ns: NDArray[np.int64],
        words: NDArray[np.uint32],
        values: Values429,
        join_rule: JoinRule = "concatenate",
    ) -> None:
        """Take one decoded block of a channel (n,): raw words, their values, and when each was true (i8, ns)."""
        equipment = definitions.equipment_id & 0xFF
        used = self._of_one_source(definitions, time_ns, words, values) & _used(equipment)[values.label]
        time_ns, words = time_ns[used], words[used]
        values = Values429(values.label[used], values.value[used], values.status[used])
        for k in np.flatnonzero(_one_by_one(equipment)[values.label]).tolist():
            label = int(values.label[k])
            if axis := AXIS_OF.get((equipment, label)):
                half = _Half(int(time_ns[k]), int(words[k]), int(values.status[k]), label == axis.coarse)
                self._join(axis, equipment, half, join_rule, _epoch_ns(definitions, axis))
            else:
                self.utc.feed(int(time_ns[k]), int(words[k]), values, k, definitions)
        by_label = np.argsort(values.label, kind="stable")
        for at in np.split(by_label, np.flatnonzero(np.diff(values.label[by_label])) + 1) if len(words) else ():
            for source in SOURCES_OF.get((equipment, int(values.label[at[0]])), ()):
                self._take(source, definitions, time_ns[at], words[at], values.value[at], values.status[at])

    def doubts(self) -> dict[str, str]:
        """By quantity, why its words seem to be read in a wrong way: the rule that joins them, or their units.

        By source, why its words are used and not those of another.
        """
        return self._strange | {name: doubt for name, check in self._joins.items() if (doubt := check.doubt())}

    def _of_one_source(
        self, definitions: Definitions, time_ns: NDArray[np.int64], words: NDArray[np.uint32], values: Values429
    ) -> NDArray[np.bool_]:
        """Which words (n,) are not of another source than the one in use: the first heard, until it falls silent.

        Words to all (SDI 0), words without an SDI and damaged ones, whose SDI says nothing, are of every source.
        """
        named = _has_sdi(definitions)[values.label] & (values.status != Status.BAD_PARITY)
        sdi = np.where(named, words >> np.uint32(8) & np.uint32(3), 0)
        equipment, heard = definitions.equipment_id & 0xFF, np.flatnonzero(sdi)
        if not heard.size:
            return np.ones(len(words), np.bool_)
        first, first_ns = int(sdi[heard[0]]), int(time_ns[heard[0]])
        source, last_ns = self._sources.get(equipment, (first, first_ns))
        if first_ns - last_ns > SILENT_NS:
            source = first
        own = np.flatnonzero(sdi == source)
        self._sources[equipment] = source, int(time_ns[own[-1]]) if own.size else last_ns
        if others := set(sdi[heard].tolist()) - {source}:
            self._strange[f"SDI {source} of equipment {equipment:02X}"] = (
                f"words of SDI {', '.join(map(str, sorted(others)))} are left out, as this one was heard first: "
                "say with sdi which one the channel is to use, or with definitions that bits 9 and 10 are data"
            )
        return np.asarray((sdi == 0) | (sdi == source))

    def _take(
        self,
        source: Source,
        definitions: Definitions,
        time_ns: NDArray[np.int64],
        words: NDArray[np.uint32],
        value: NDArray[np.float64],
        status: NDArray[np.uint8],
    ) -> None:
        definition = definitions.labels.get(source.label)
        if definition is None or (source.bits and source.bits not in definition.fields):
            return
        if definition.units not in SI:
            self._strange[source.quantity.name] = (
                f"label {source.label:03o} of {definitions.name} is in {definition.units!r}: "
                f"give it in one of {', '.join(sorted(SI))}"
            )
            return
        if source.bits:
            given = arinc429.field(words, definition, source.bits).astype(np.float64)
        else:
            given = value * SI[definition.units]
        equipment = definitions.equipment_id & 0xFF
        if source.quantity is not HEIGHT or self.height_source == "076":
            self._append(source.quantity, equipment, time_ns, given, status)
        if source.quantity is ELLIPSOID_HEIGHT and self.height_source == "370":
            undulation, known = self._undulation_m(time_ns)
            self._append(HEIGHT, equipment, time_ns, given - undulation, np.maximum(status, known))

    def _undulation_m(self, time_ns: NDArray[np.int64]) -> tuple[float, NDArray[np.uint8]]:
        """Geoid over ellipsoid at the newest position, and the status of that position at times i8 (n,)."""
        newest = [self.tracks[quantity.name].newest for quantity in (LATITUDE, LONGITUDE)]
        if newest[0] is None or newest[1] is None:
            return 0.0, np.full(len(time_ns), Status.NO_COMPUTED_DATA, np.uint8)
        (one_ns, latitude, one), (other_ns, longitude, other) = newest[0], newest[1]
        if max(one, other) != NORMAL:
            return 0.0, np.full(len(time_ns), max(one, other), np.uint8)
        old = time_ns - min(one_ns, other_ns) > round(LATITUDE.longest_gap_s * 1e9)
        return geoid.undulation_m(latitude, longitude), np.where(old, STALE, NORMAL).astype(np.uint8)

    def _append(
        self,
        quantity: Quantity,
        equipment: int,
        time_ns: NDArray[np.int64],
        value: NDArray[np.float64],
        status: NDArray[np.uint8],
    ) -> None:
        track, owner = self.tracks[quantity.name], self._owners.get(quantity.name, equipment)
        if owner != equipment:
            newest = track.newest
            if newest and time_ns[0] - newest[0] <= 2e9 * quantity.longest_gap_s:
                return
            self.tracks[quantity.name] = track = Track(quantity)
        self._owners[quantity.name] = equipment
        track.append(time_ns, value, status)

    def _join(self, axis: Axis, equipment: int, half: _Half, rule: JoinRule, epoch_ns: int) -> None:
        other = self._halves.pop(axis.quantity.name, None)
        if half.status != NORMAL:  # a hole by itself, as the other half may be lost
            self._append(axis.quantity, equipment, *_sample(half.time_ns, 0.0, half.status))
            return
        if other is None or other.coarse == half.coarse or abs(half.time_ns - other.time_ns) > epoch_ns:
            self._halves[axis.quantity.name] = half
            return
        coarse, fine = (half, other) if half.coarse else (other, half)
        words = np.array([coarse.word], np.uint32), np.array([fine.word], np.uint32)
        degrees = float(arinc429.join_position(*words, rule)[0])
        impossible = axis.quantity.name.endswith("latitude_deg") and abs(degrees) > 90
        self._joins[axis.quantity.name].feed(*words, rule)
        status = int(Status.INVALID_DATA) if impossible else NORMAL
        self._append(axis.quantity, equipment, *_sample(coarse.time_ns, degrees, status))


def _sample(
    time_ns: int, value: float, status: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.uint8]]:
    return np.array([time_ns]), np.array([value]), np.array([status], np.uint8)
