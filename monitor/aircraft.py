"""The aircraft's state from decoded ARINC 429 words: which label of which equipment gives which quantity, and when.

Position comes from the GNSS, whose coarse and fine words are joined only within one navigation epoch. Nothing stands in
for it silently: an inertial position steps by 19 m and drifts, so it is kept beside, never instead. Two sources of one
quantity are never mixed either, be they two kinds of equipment or two SDIs on one bus: the first is used until it falls
silent.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from decoders.arinc429 import JoinRule, Status, Values429
from decoders.definitions import Definitions
from monitor import geoid
from monitor.gathering import LONGEST_NS, Geoid, claim, gather, given, nobody, own_words
from monitor.join_check import JoinCheck
from monitor.quantities import AXES, AXIS_OF, GNSS, LATITUDE, LONGITUDE, QUANTITIES, ROW_OF, Axis
from monitor.settings import HeightSource
from monitor.track import MISSING, NORMAL, STALE, Quantity, Samples, Track, put
from monitor.utc import UTC_LABELS, UtcClock

NO_GEOID = Geoid(0.0, int(Status.NO_COMPUTED_DATA), 0)  # a number of its own, as a member would be typed anew each time
EPOCH_NS = 40_000_000  # a set is sent in one burst, at low speed in 35 ms


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


def _epoch_ns(definitions: Definitions, axis: Axis) -> int:
    """How far apart the words of one epoch may be: less than half the time to the next epoch."""
    definition = definitions.labels.get(axis.coarse)
    shortest_ms = definition.interval_ms[0] if definition and definition.interval_ms else math.inf
    return min(EPOCH_NS, round(min(shortest_ms, 1000.0) * 1e6 / 2))


def status_name(status: int) -> str:
    """The name of a status as it stands in reasons: a bus status, STALE or MISSING."""
    return {STALE: "STALE", MISSING: "MISSING"}.get(status) or Status(status).name


class Aircraft:
    """Tracks of every quantity, fed with decoded blocks; heights are above mean sea level, metres.

    `height_source` "370" makes the height from the GNSS height above the ellipsoid and the EGM96 geoid.
    """

    def __init__(self, height_source: HeightSource = "076") -> None:
        self.height_source: HeightSource = height_source
        self.utc = UtcClock()
        self._samples = Samples.empty(len(QUANTITIES))
        self.tracks = {q.name: Track(q, self._samples, row) for row, q in enumerate(QUANTITIES)}
        self._owners = nobody()  # by quantity, the equipment that gives it
        self._sources: dict[int, tuple[int, int]] = {}  # equipment -> SDI in use, when last heard
        self._left_out: dict[int, int] = {}  # equipment -> which SDIs, as `own_words` gives them
        self._strange: dict[str, str] = {}
        self._halves: dict[str, _Half] = {}
        self._joins = {axis.quantity.name: JoinCheck() for axis in AXES}

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
        own = np.empty(len(words), np.bool_)
        for k in self._of_one_source(definitions, time_ns, words, values, own):
            label = int(values.label[k])
            if axis := AXIS_OF.get((equipment, label)):
                half = _Half(int(time_ns[k]), int(words[k]), int(values.status[k]), label == axis.coarse)
                self._join(axis, equipment, half, join_rule, _epoch_ns(definitions, axis))
            else:
                self.utc.feed(int(time_ns[k]), int(words[k]), values, k, definitions)
        gives, first, strange = given(definitions, self.height_source)
        self._strange |= {strange[label][0]: strange[label][1] for label in strange if (values.label == label).any()}
        gather(
            self._samples, self._owners, equipment, gives, first, self._geoid(), LONGEST_NS,
            time_ns, words, own, values.label, values.value, values.status,
        )  # fmt: skip

    def doubts(self) -> dict[str, str]:
        """By quantity, why its words seem to be read in a wrong way: the rule that joins them, or their units.

        By source, why its words are used and not those of another.
        """
        return self._strange | {name: doubt for name, check in self._joins.items() if (doubt := check.doubt())}

    def _of_one_source(
        self,
        definitions: Definitions,
        time_ns: NDArray[np.int64],
        words: NDArray[np.uint32],
        values: Values429,
        own: NDArray[np.bool_],
    ) -> list[int]:
        """Mark the words (n,) that are not of another source than the one in use: the first heard, until it is silent.

        Gives those of them that are to be taken in their order.
        """
        equipment = definitions.equipment_id & 0xFF
        kinds, before = (_has_sdi(definitions), _one_by_one(equipment)), self._sources.get(equipment, (0, 0))
        in_order, source, last_ns, others = own_words(time_ns, words, values.label, values.status, *kinds, *before, own)
        self._sources[equipment] = source, last_ns
        if others:
            self._left_out[equipment] = self._left_out.get(equipment, 0) | others
            self._strange |= _left_out(equipment, self._left_out[equipment])
        found: list[int] = in_order.tolist()
        return found

    def _geoid(self) -> Geoid:
        """Geoid over ellipsoid at the newest position."""
        if self.height_source != "370":
            return NO_GEOID
        newest = [self.tracks[quantity.name].newest for quantity in (LATITUDE, LONGITUDE)]
        if newest[0] is None or newest[1] is None:
            return NO_GEOID
        (one_ns, latitude, one), (other_ns, longitude, other) = newest[0], newest[1]
        if max(one, other) != NORMAL:
            return Geoid(0.0, max(one, other), 0)
        stale_from_ns = min(one_ns, other_ns) + round(LATITUDE.longest_gap_s * 1e9) + 1
        return Geoid(geoid.undulation_m(latitude, longitude), NORMAL, stale_from_ns)

    def _append(self, quantity: Quantity, equipment: int, time_ns: int, value: float, status: int) -> None:
        row = ROW_OF[quantity.name]
        if claim(self._samples, self._owners, row, equipment, time_ns, LONGEST_NS):
            put(self._samples, row, time_ns, value, status)

    def _join(self, axis: Axis, equipment: int, half: _Half, rule: JoinRule, epoch_ns: int) -> None:
        other = self._halves.pop(axis.quantity.name, None)
        if half.status != NORMAL:  # a hole by itself, as the other half may be lost
            self._append(axis.quantity, equipment, half.time_ns, 0.0, half.status)
            return
        if other is None or other.coarse == half.coarse or abs(half.time_ns - other.time_ns) > epoch_ns:
            self._halves[axis.quantity.name] = half
            return
        coarse, fine = (half, other) if half.coarse else (other, half)
        degrees = self._joins[axis.quantity.name].feed(coarse.word, fine.word, rule)
        impossible = axis.quantity.name.endswith("latitude_deg") and abs(degrees) > 90
        status = int(Status.INVALID_DATA) if impossible else NORMAL
        self._append(axis.quantity, equipment, coarse.time_ns, degrees, status)


def _left_out(equipment: int, others: int) -> dict[str, str]:
    """By source, why its words are used and not those of others, which `own_words` left out."""
    found = {}
    for source in range(1, 4):
        if left_out := ", ".join(str(sdi) for sdi in range(1, 4) if others >> 4 * source + sdi & 1):
            found[f"SDI {source} of equipment {equipment:02X}"] = (
                f"words of SDI {left_out} are left out, as this one was heard first: "
                "say with sdi which one the channel is to use, or with definitions that bits 9 and 10 are data"
            )
    return found
