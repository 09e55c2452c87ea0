"""How well an ARINC 429 bus behaves: intervals, load, equipment, and whether the words are read the right way.

Findings are told when they begin and when they end, never word by word. Nothing is judged on less than a second of bus.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from decoders import kernels429_health as kernels
from decoders.arinc429 import Values429
from decoders.definitions import Definitions
from decoders.formats import KIND_429_LOW

MOST_WORDS_PER_S: Final = {"high": 1e5 / 36, "low": 12.5e3 / 36}  # 36 bit times a word, its gap included
OVERLOAD: Final = 1.02  # of what the bus carries, for two clocks that differ
EQUIPMENT: Final = kernels.EQUIPMENT
NORMAL: Final = kernels.NORMAL
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


class _Rates(NamedTuple):
    """By label (256,): words since it was last judged, the last one of before included, when they came, words ever."""

    first_ns: npt.NDArray[np.int64]
    last_ns: npt.NDArray[np.int64]
    lately: npt.NDArray[np.int64]
    ever: npt.NDArray[np.int64]

    @classmethod
    def none(cls) -> Self:
        """No word yet."""
        return cls(*(np.zeros(256, np.int64) for _ in cls._fields))


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
        self._shortest_ms = np.array([float(given[0]) if given else 0.0 for given in intervals])
        self._longest_ms = np.array([float((given[1] if given else None) or np.inf) for given in intervals])
        self._told = np.zeros(256, np.uint8)  # by label, what is told of its rate and not over
        self._rates = _Rates.none()
        self._wrong: set[str] = set()
        self._second_ns: int | None = None  # when the current second began
        self._words = 0
        self._known = np.zeros(4, np.int64)  # words since reading was last judged, as `tally` counts them

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
                self._rates = _Rates.none()
                self._words = -1  # its first word opens the second and is not of it
            block = time_ns, words, values.label, values.value, values.status
            sets, tallies = (self.has_sdi, self._is_known, TURNED), (self._sources, self._known, *self._rates)
            limits = start, self._second_ns + SECOND_NS, self._definitions.equipment_id & 0xFF
            end, whole, right, wrong = kernels.tally(*limits, *block, *sets, *tallies)
            self._words += end - start
            if wrong or (right and "equipment" in self._wrong):
                yield from self._equipment(values, slice(start, end))
            if whole:
                yield from self._judge(int(time_ns[end - 1]))
            start = end

    def _equipment(self, values: Values429, part: slice) -> Iterator[Finding]:
        """What the box says of itself is judged at once."""
        said = (values.label[part] == EQUIPMENT) & (values.status[part] == NORMAL)
        for code in values.value[part][said].astype(int).tolist():
            wrong = code & 0xFF != self._definitions.equipment_id & 0xFF
            form = "the box says it is equipment {:03X}, it is read as {}"
            yield from self._tell("equipment", wrong, form, code, self._definitions.name)

    def _judge(self, now_ns: int) -> Iterator[Finding]:
        load, most = self._words * SECOND_NS / (now_ns - (self._second_ns or 0)), MOST_WORDS_PER_S[self._speed]
        self.peak_words_per_s = max(self.peak_words_per_s, load)
        form = "{:.0f} words/s, a {} speed bus carries {:.1f} at most"
        yield from self._tell("load", load > OVERLOAD * most, form, load, self._speed, most)
        changed, flags, mean_ms, silent_ms, shared = kernels.settle(
            now_ns, self._shortest_ms, self._longest_ms, self._told, self._sources, *self._rates
        )
        for k, label in enumerate(changed.tolist()):
            yield from self._rate(label, int(flags[k]), float(mean_ms[k]), float(silent_ms[k]))
        good, bad, *known = self._known.tolist()
        if good + bad >= ENOUGH_WORDS:
            yield from self._reading(good, bad, *known)
            self._known[:] = 0
        form = "labels {} come from several sources (SDI): say with sdi which one the channel is to use"
        labels = ", ".join(f"{label:03o}" for label in shared.tolist())
        yield from self._tell("sources", bool(labels), form, labels)
        self._second_ns, self._words = now_ns, 0

    def _rate(self, label: int, flags: int, mean_ms: float, silent_ms: float) -> Iterator[Finding]:
        """Tell what has changed of a label's rate."""
        shortest, longest = self._shortest_ms[label], self._longest_ms[label]
        every = f"label {label:03o} comes every {mean_ms:.1f} ms"
        silent = f"label {label:03o} has not come for {silent_ms:.0f} ms"
        reasons = {
            kernels.FAST: (f"rate of {label:03o}", f"{every}, {shortest:g} is the shortest interval"),
            kernels.SLOW: (f"slowness of {label:03o}", f"{every}, {longest:g} is the longest interval"),
            kernels.STOPPED: (f"label {label:03o}", f"{silent}, {longest:g} is the longest interval"),
        }
        for flag, (about, reason) in reasons.items():
            if (flags ^ int(self._told[label])) & flag:
                yield _finding(about, bool(flags & flag), reason)
        self._told[label] = flags

    def _reading(self, good: int, bad: int, known: int, turned: int) -> Iterator[Finding]:
        form = "parity is bad in {} of {} words: noise, or bits in another order"
        yield from self._tell("parity", _beyond(bad / (good + bad), *BAD_PARITY), form, bad, good + bad)
        if good:
            name, share, turned_share = self._definitions.name, known / good, turned / good
            unclear = FEW <= share <= MORE
            form = (
                "{:.0%} of the labels belong to {}, {:.0%} if read the other way round: "
                "check the channel's orientation, which is {!r}"
            )
            wrong = None if unclear else share < FEW and turned_share > MOST
            yield from self._tell("orientation", wrong, form, share, name, turned_share, self._orientation)
            form = "{:.0%} of the labels belong to {}: check the channel's definitions"
            wrong = None if unclear else share < FEW and turned_share <= MOST
            yield from self._tell("definitions", wrong, form, share, name)

    def _tell(self, about: str, wrong: bool | None, form: str, *said: object) -> Iterator[Finding]:
        """Tell a change; None stands for neither right nor wrong, which changes nothing."""
        if wrong is not None and wrong != (about in self._wrong):
            (self._wrong.add if wrong else self._wrong.discard)(about)
            yield _finding(about, wrong, form.format(*said))


def _finding(about: str, wrong: bool, reason: str) -> Finding:
    return Finding(about, wrong, reason if wrong else f"{about} is in order again")


def _beyond(value: float, wrong_above: float, right_below: float) -> bool | None:
    """Whether a value is wrong; None between the limit that begins a finding and the one that ends it."""
    return True if value > wrong_above else False if value <= right_below else None
