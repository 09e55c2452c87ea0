"""UTC of the GNSS receiver: date (260), time of day (150), its fraction (140) and the fraction's fraction (141).

The words of one set belong together, but their order on the bus is free and around midnight the time may roll over
before the date: within seconds of midnight the day is chosen that follows from the last set. In a leap second 150
counts to 23:59:60, which is the same count of seconds as the midnight after it.
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple

from decoders import arinc429
from decoders.arinc429 import Status, Values429
from decoders.definitions import Definitions

DATE, TIME, FRACTION, FINE_FRACTION = 0o260, 0o150, 0o140, 0o141
UTC_LABELS: Final = frozenset({DATE, TIME, FRACTION, FINE_FRACTION})
SET_NS: Final = 40_000_000  # a set is sent in one burst
HOLDS_NS: Final = 2_500_000_000  # how long a date, or a whole set, holds without another
MIDNIGHT_S: Final = 10  # how far around midnight date and time may not belong together
NEAR_NS: Final = 5_000_000_000
DAY_S: Final = 86_400
DAY_NS: Final = DAY_S * 1_000_000_000
EPOCH_2000_NS: Final = 946_684_800_000_000_000  # 2000-01-01 after 1970-01-01


class Utc(NamedTuple):
    """UTC, ns since 1970 without leap seconds, or None; what it is worth: NORMAL, NOT_PRECISE, STALE or MISSING."""

    utc_ns: int | None
    validity: str


@dataclass
class UtcClock:
    """Fed with the time words of one receiver; says UTC at any later time of the same clock."""

    _parts: dict[int, tuple[int, float]] = field(default_factory=dict)  # label -> when sent, value
    _precise: bool = False
    _offset_ns: int | None = None  # UTC minus the clock of the stamps, at the last set
    _set_ns: int = 0

    def feed(self, time_ns: int, word: int, values: Values429, k: int, definitions: Definitions) -> None:
        """Take word k of a decoded block, sent at `time_ns`; a word that is not normal ends what was known."""
        label = int(values.label[k])
        if values.status[k] != Status.NORMAL:
            self._parts.pop(label, None)
            return
        self._parts[label] = time_ns, float(values.value[k])
        if label == TIME:
            row = definitions.labels[TIME]
            self._precise = "precise" in row.fields and bool(arinc429.field([word], row, "precise")[0])
        if label != DATE:
            self._complete(time_ns)

    def at(self, time_ns: int) -> Utc:
        """UTC at a time of the words' clock."""
        if self._offset_ns is None:
            return Utc(None, "MISSING")
        if time_ns - self._set_ns > HOLDS_NS:
            return Utc(None, "STALE")
        return Utc(time_ns + self._offset_ns, "NORMAL" if self._precise else "NOT_PRECISE")

    def _complete(self, now_ns: int) -> None:
        parts = self._parts
        if TIME not in parts or DATE not in parts or now_ns - parts[DATE][0] > HOLDS_NS:
            return
        sent_ns, seconds = parts[TIME]
        if now_ns - sent_ns > SET_NS:  # a fraction of the next set, whose time is still to come
            return
        near = [parts[x][1] for x in (FRACTION, FINE_FRACTION) if x in parts and abs(parts[x][0] - sent_ns) <= SET_NS]
        if FRACTION in parts and not near:
            return
        utc_ns = (
            EPOCH_2000_NS + round(parts[DATE][1]) * DAY_NS + round(seconds) * 1_000_000_000 + round(sum(near) * 1e9)
        )
        if self._offset_ns is not None and sent_ns >= self._set_ns and (seconds + MIDNIGHT_S) % DAY_S <= 2 * MIDNIGHT_S:
            expected_ns = sent_ns + self._offset_ns
            near_days = [ns for ns in (utc_ns - DAY_NS, utc_ns + DAY_NS) if abs(ns - expected_ns) <= NEAR_NS]
            utc_ns = near_days[0] if near_days else utc_ns
        self._offset_ns, self._set_ns = utc_ns - sent_ns, sent_ns
