"""How well an ARINC 429 bus behaves: intervals, load, equipment, and whether the words are read the right way.

Findings are told when they begin and when they end, never word by word. Nothing is judged on less than a second of bus.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from decoders import kernels429
from decoders.arinc429 import Status, Values429
from decoders.definitions import Definitions
from decoders.formats import KIND_429_LOW

MOST_WORDS_PER_S: Final = {"high": 1e5 / 36, "low": 12.5e3 / 36}  # 36 bit times a word, its gap included
# What begins a finding and what ends it lie apart, so that nothing on the edge is told every second.
TOO_FAST: Final = (0.75, 0.9)  # of the shortest interval, on average between the words of a second or more
TOO_SLOW: Final = (1.25, 1.1)  # of the longest
STOPPED: Final = 3.0  # of the longest, and a second at least
OFTEN: Final = 3  # words of a label before its silence means anything: a damaged label passes the parity too
OVERLOAD: Final = 1.02  # of what the bus carries, for two clocks that differ
EQUIPMENT: Final = 0o377
ENOUGH_WORDS: Final = 100  # before reading order and parity are judged
FEW, MORE, MOST = 0.2, 0.4, 0.8  # shares of words
BAD_PARITY: Final = (0.2, 0.1)
SECOND_NS: Final = 1_000_000_000
TURNED: Final = np.array([int(f"{label:08b}"[::-1], 2) for label in range(256)], np.uint8)


class Finding(NamedTuple):
    """Something that is wrong with a bus, or is no longer. `about` tells findings apart: a label, or what is judged."""

    about: str
    wrong: bool
    reason: str


class _Rates:
    """By label (256,): words since it was last judged, the last one of before included, when they came, words ever."""

    def __init__(self) -> None:
        self.first_ns = np.zeros(256, np.int64)
        self.last_ns = np.zeros(256, np.int64)
        self.count = np.zeros(256, np.int64)
        self.ever = np.zeros(256, np.int64)

    def judged(self, labels: int | npt.NDArray[np.bool_]) -> None:
        """What came so far of a label, or of those of a mask (256,), is judged."""
        self.first_ns[labels], self.count[labels] = self.last_ns[labels], 1


class BusHealth:
    """One channel. `peak_words_per_s` is the highest load of any whole second."""

    def __init__(self, definitions: Definitions, orientation: str, kind: int) -> None:
        self.peak_words_per_s = 0.0
        self._definitions = definitions
        self._orientation = orientation
        self._speed = "low" if kind == KIND_429_LOW else "high"
        self.has_sdi = np.isin(np.arange(256), [label for label, row in definitions.labels.items() if row.has_sdi])
        self._sources = np.zeros((256, 4), np.bool_)  # by label and SDI, whether this second had such a word
        self._is_known = np.isin(np.arange(256), list(definitions.labels))
        intervals = [definitions.labels[k].interval_ms if self._is_known[k] else None for k in range(256)]
        self._shortest_ms = np.array([given[0] if given else 0.0 for given in intervals])
        self._longest_ms = np.array([(given[1] if given else None) or np.inf for given in intervals])
        self._told = np.zeros(256, np.bool_)  # by label, whether something is told of it that is not over
        self._rates = _Rates()
        self._wrong: set[str] = set()
        self._second_ns: int | None = None  # when the current second began
        self._words = 0
        self._known = Counter[str]()  # words since reading was last judged, by what they say of it

    def feed(
        self, time_ns: npt.NDArray[np.int64], words: npt.NDArray[np.uint32], values: Values429
    ) -> Iterator[Finding]:
        """Take one decoded block (n,) with the device times of its words in order; give what has changed.

        A second is judged at its last word, so it does not matter how the words are cut into blocks.
        """
        start = 0
        while start < len(time_ns):
            if self._second_ns is None or time_ns[start] < self._second_ns:  # the first word, or a clock begun anew
                self._second_ns = int(time_ns[start])
                self._rates = _Rates()
                self._words = -1  # its first word opens the second and is not of it
            end = int(np.searchsorted(time_ns[start:], self._second_ns + SECOND_NS)) + start + 1
            part = slice(start, end)
            yield from self._count(
                time_ns[part], words[part], Values429(values.label[part], values.value[part], values.status[part])
            )
            if end <= len(time_ns):
                yield from self._judge(int(time_ns[end - 1]))
            start = end

    def _count(
        self, time_ns: npt.NDArray[np.int64], words: npt.NDArray[np.uint32], values: Values429
    ) -> Iterator[Finding]:
        """Take words of one second; what a box says of itself is judged at once."""
        rates = self._rates
        good, known, turned = kernels429.tally(
            time_ns, words, values.label, values.status, self.has_sdi, self._is_known, TURNED, self._sources,
            rates.first_ns, rates.last_ns, rates.count, rates.ever,
        )  # fmt: skip
        self._words += len(words)
        for what, count in (("good", good), ("bad parity", len(words) - good), ("known", known), ("turned", turned)):
            self._known[what] += count
        for said in values.value[(values.label == EQUIPMENT) & (values.status == Status.NORMAL)].astype(int).tolist():
            reason = f"the box says it is equipment {said:03X}, it is read as {self._definitions.name}"
            yield from self._tell("equipment", said & 0xFF != self._definitions.equipment_id & 0xFF, reason)

    def _judge(self, now_ns: int) -> Iterator[Finding]:
        load = self._words * SECOND_NS / (now_ns - (self._second_ns or 0))
        self.peak_words_per_s = max(self.peak_words_per_s, load)
        most = MOST_WORDS_PER_S[self._speed]
        reason = f"{load:.0f} words/s, a {self._speed} speed bus carries {most:.1f} at most"
        yield from self._tell("load", load > OVERLOAD * most, reason)
        in_order = self._in_order(now_ns)
        for label in np.flatnonzero((self._rates.ever > 0) & ~in_order).tolist():
            yield from self._rate(label, now_ns)
        self._rates.judged(in_order & (self._rates.count > 1))
        if self._known["good"] + self._known["bad parity"] >= ENOUGH_WORDS:
            yield from self._reading()
        several = np.flatnonzero(self._sources[:, 1:].sum(axis=1) > 1)
        shared = ", ".join(f"{label:03o}" for label in several)
        reason = f"labels {shared} come from several sources (SDI): say with sdi which one the channel is to use"
        yield from self._tell("sources", bool(shared), reason)
        self._sources[:] = False
        self._second_ns, self._words = now_ns, 0

    def _in_order(self, now_ns: int) -> npt.NDArray[np.bool_]:
        """By label (256,), whether there is clearly nothing to tell of it: neither anything new, nor an end."""
        rates = self._rates
        mean_ms = (rates.last_ns - rates.first_ns) / 1e6 / np.maximum(rates.count - 1, 1)
        kept = (mean_ms >= TOO_FAST[1] * self._shortest_ms) & (mean_ms <= TOO_SLOW[1] * self._longest_ms)
        silent_ms = (now_ns - rates.last_ns) / 1e6
        heard = (silent_ms <= STOPPED * self._longest_ms) | (silent_ms <= SECOND_NS / 1e6)
        return ~self._told & (kept | (rates.count < 2)) & heard

    def _rate(self, label: int, now_ns: int) -> Iterator[Finding]:
        rates = self._rates
        shortest, longest = float(self._shortest_ms[label]), float(self._longest_ms[label])
        stopped, fast, slow = (f"{what}{label:03o}" for what in ("label ", "rate of ", "slowness of "))
        if rates.count[label] > 1 and stopped in self._wrong:  # the gap that was told is no interval
            rates.judged(label)
        if rates.count[label] > 1:
            mean_ms = float(rates.last_ns[label] - rates.first_ns[label]) / 1e6 / (rates.count[label] - 1)
            said = f"label {label:03o} comes every {mean_ms:.1f} ms"
            wrong = _beyond(-mean_ms, -TOO_FAST[0] * shortest, -TOO_FAST[1] * shortest)
            yield from self._tell(fast, wrong, f"{said}, {shortest:g} is the shortest interval")
            wrong = _beyond(mean_ms, TOO_SLOW[0] * longest, TOO_SLOW[1] * longest)
            yield from self._tell(slow, wrong, f"{said}, {longest:g} is the longest interval")
            rates.judged(label)
        if rates.ever[label] >= OFTEN:
            silent_ms = (now_ns - int(rates.last_ns[label])) / 1e6
            reason = f"label {label:03o} has not come for {silent_ms:.0f} ms, {longest:g} is the longest interval"
            yield from self._tell(stopped, silent_ms > max(STOPPED * longest, SECOND_NS / 1e6), reason)
        self._told[label] = bool({stopped, fast, slow} & self._wrong)

    def _reading(self) -> Iterator[Finding]:
        good, bad = self._known["good"], self._known["bad parity"]
        noisy = f"parity is bad in {bad} of {good + bad} words: noise, or bits in another order"
        yield from self._tell("parity", _beyond(bad / (good + bad), *BAD_PARITY), noisy)
        if good:
            known, turned = self._known["known"] / good, self._known["turned"] / good
            name, unclear = self._definitions.name, FEW <= known <= MORE
            order = (
                f"{known:.0%} of the labels belong to {name}, {turned:.0%} if read the other way round: "
                f"check the channel's orientation, which is {self._orientation!r}"
            )
            yield from self._tell("orientation", None if unclear else known < FEW and turned > MOST, order)
            other = f"{known:.0%} of the labels belong to {name}: check the channel's definitions"
            yield from self._tell("definitions", None if unclear else known < FEW and turned <= MOST, other)
        self._known.clear()

    def _tell(self, about: str, wrong: bool | None, reason: str) -> Iterator[Finding]:
        """Tell a change; None stands for neither right nor wrong, which changes nothing."""
        if wrong is not None and wrong != (about in self._wrong):
            (self._wrong.add if wrong else self._wrong.discard)(about)
            yield Finding(about, wrong, reason if wrong else f"{about} is in order again")


def _beyond(value: float, wrong_above: float, right_below: float) -> bool | None:
    """Whether a value is wrong; None between the limit that begins a finding and the one that ends it."""
    return True if value > wrong_above else False if value <= right_below else None
