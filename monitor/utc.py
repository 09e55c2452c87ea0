"""UTC of the GNSS receiver: date (260), time of day (150), its fraction (140) and the fraction's fraction (141).

The words of one set belong together, but their order on the bus is free and around midnight the time may roll over
before the date: within seconds of midnight the day is chosen that follows from the last set. In a leap second 150
counts to 23:59:60, which is the same count of seconds as the midnight after it.

A set is whole once it has every fraction that the receiver gives. Without a fraction the time of day is up to a second
wrong, so a set that lacks one changes nothing.
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple

from decoders import arinc429
from decoders.arinc429 import Status, Values429
from decoders.definitions import Definitions

DATE, TIME, FRACTION, FINE_FRACTION = 0o260, 0o150, 0o140, 0o141
FRACTIONS: Final = frozenset({FRACTION, FINE_FRACTION})
UTC_LABELS: Final = FRACTIONS | {DATE, TIME}
SET_NS: Final = 40_000_000  # a set is sent in one burst
HOLDS_NS: Final = 2_500_000_000  # how long a date, or a whole set, holds without another
MIDNIGHT_S: Final = 10  # how far around midnight date and time may not belong together
NEAR_NS: Final = 5_000_000_000
DAY_S: Final = 86_400
DAY_NS: Final = DAY_S * 1_000_000_000
EPOCH_2000_NS: Final = 946_684_800_000_000_000  # 2000-01-01 after 1970-01-01


class Utc(NamedTuple):
    """UTC, ns since 1970 without leap seconds, or None; what it is worth.

    `validity` is NORMAL, NOT_PRECISE, STALE, MISSING, or the bus status of the date or time of day that ended it.
    """

    utc_ns: int | None
    validity: str


@dataclass
class UtcClock:
    """Fed with the time words of one receiver; says UTC at any later time of the same clock."""

    _parts: dict[int, tuple[int, float]] = field(default_factory=dict)  # label -> when sent, value
    _given: set[int] = field(default_factory=set)  # the fractions that this receiver gives
    _times: int = 0  # of day, heard in a row
    _marked_precise: bool = False  # by the last of them
    _heard_ns: int = 0  # when the last word was sent
    _ended: str = ""  # the status of a date or time of day that was not normal, until the next whole set
    _precise: bool = False  # whether the last whole set was marked so
    _offset_ns: int | None = None  # UTC minus the clock of the stamps, at the last set
    _set_ns: int = 0

    def feed(self, time_ns: int, word: int, values: Values429, k: int, definitions: Definitions) -> None:
        """Take word k of a decoded block, sent at `time_ns`; a date or time that is not normal ends what was known."""
        label, status = int(values.label[k]), Status(int(values.status[k]))
        if time_ns - self._heard_ns > HOLDS_NS:  # it may be another receiver that speaks now
            self._times = 0
            self._given.clear()
        self._heard_ns = time_ns
        if label in FRACTIONS and status is not Status.BAD_PARITY:  # which may be of another label
            self._given |= {FRACTION, label}
        if status is not Status.NORMAL:
            self._parts.pop(label, None)
            if label not in FRACTIONS:
                self._ended = status.name
            return
        self._parts[label] = time_ns, float(values.value[k])
        if label == TIME:
            self._times += 1
            row = definitions.labels[TIME]
            self._marked_precise = "precise" in row.fields and bool(arinc429.field([word], row, "precise")[0])
        if label != DATE:
            self._complete(time_ns)

    def at(self, time_ns: int) -> Utc:
        """UTC at a time of the words' clock."""
        if self._offset_ns is None:
            return Utc(None, "MISSING")
        if self._ended:
            return Utc(None, self._ended)
        if time_ns - self._set_ns > HOLDS_NS:
            return Utc(None, "STALE")
        return Utc(time_ns + self._offset_ns, "NORMAL" if self._precise and self._marked_precise else "NOT_PRECISE")

    def _complete(self, now_ns: int) -> None:
        parts = self._parts
        if TIME not in parts or DATE not in parts or now_ns - parts[DATE][0] > HOLDS_NS:
            return
        sent_ns, seconds = parts[TIME]
        if now_ns - sent_ns > SET_NS:  # a fraction of the next set, whose time is still to come
            return
        fractions = [parts[x][1] for x in self._given if x in parts and abs(parts[x][0] - sent_ns) <= SET_NS]
        if len(fractions) < len(self._given) or (self._times == 1 and not fractions):  # which may be still to come
            return
        utc_ns = EPOCH_2000_NS + round(parts[DATE][1]) * DAY_NS + round(seconds) * 1_000_000_000
        utc_ns += round(sum(fractions) * 1e9)
        if self._offset_ns is not None and sent_ns >= self._set_ns:
            # After midnight a date may be late, before it early, and never the other way round.
            late, early = seconds <= MIDNIGHT_S, seconds >= DAY_S - MIDNIGHT_S
            other_day_ns = utc_ns + (late - early) * DAY_NS
            if abs(other_day_ns - sent_ns - self._offset_ns) <= NEAR_NS:
                utc_ns = other_day_ns
        self._offset_ns, self._set_ns = utc_ns - sent_ns, sent_ns
        self._precise, self._ended = self._marked_precise, ""
