"""Decoded words to samples of the aircraft's quantities, in one compiled pass over a block."""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from decoders.definitions import Definitions
from decoders.results429 import Status
from monitor.quantities import ELLIPSOID_HEIGHT, HEIGHT, QUANTITIES, ROW_OF, SI, SOURCES_OF
from monitor.settings import HeightSource
from monitor.track import NORMAL, STALE, put

BAD_PARITY: Final = int(Status.BAD_PARITY)
SILENT_NS: Final = 2_500_000_000  # of a source; nothing is interpolated over so long a gap, so another can follow it
NOBODY: Final = -1  # owns a quantity
LONGEST_NS: Final = np.array([round(2e9 * q.longest_gap_s) for q in QUANTITIES])  # silence of a quantity's owner
GIVES: Final = np.dtype(
    [("row", "i8"), ("scale", "f8"), ("shift", "i8"), ("mask", "i8"), ("from_ellipsoid", "?")]
)  # of the quantity; SI units, or the bits of the word that say it (mask 0: none); whether the geoid is to be taken off


class Geoid(NamedTuple):
    """How high the geoid lies over the ellipsoid, and what the position is worth that says so."""

    undulation_m: float
    status: int
    stale_from_ns: int


class Given(NamedTuple):
    """What the labels of a set give: rows `gives[first[label] : first[label + 1]]`; why some give nothing."""

    gives: NDArray[np.void]
    first: NDArray[np.int64]  # (257,)
    strange: dict[int, tuple[str, str]]  # label -> quantity, reason


@cache
def given(definitions: Definitions, height_source: HeightSource) -> Given:
    """What is made of the words of a label set."""
    rows: list[list[tuple[int, float, int, int, bool]]] = [[] for _ in range(256)]
    strange: dict[int, tuple[str, str]] = {}
    for label, definition in definitions.labels.items():
        for source in SOURCES_OF.get((definitions.equipment_id & 0xFF, label), ()):
            if source.bits and source.bits not in definition.fields:
                continue
            if definition.units not in SI:
                said = f"label {label:03o} of {definitions.name} is in {definition.units!r}"
                strange[label] = source.quantity.name, f"{said}: give it in one of {', '.join(sorted(SI))}"
                continue
            begin, end = definition.fields[source.bits] if source.bits else (1, 0)
            way = SI[definition.units], begin - 1, (1 << end - begin + 1) - 1
            if source.quantity is not HEIGHT or height_source == "076":
                rows[label].append((ROW_OF[source.quantity.name], *way, False))
            if source.quantity is ELLIPSOID_HEIGHT and height_source == "370":
                rows[label].append((ROW_OF[HEIGHT.name], *way, True))
    first = np.cumsum([0, *map(len, rows)])
    return Given(np.array([row for of_label in rows for row in of_label], GIVES), first, strange)


def nobody() -> NDArray[np.int64]:
    """By quantity, which equipment gives it: none yet."""
    return np.full(len(QUANTITIES), NOBODY)


@njit(cache=True)
def gather(  # type: ignore[no-untyped-def] # typed by Aircraft
    samples, owners, equipment, gives, first, geoid, longest_ns, time_ns, words, own, label, value, status
):
    """Add to the samples what the words (n,) of one equipment give, but those that are not `own`."""
    allowed = np.full(owners.size, -1)
    for i in range(words.size):
        for k in range(first[label[i]], first[label[i] + 1]) if own[i] else range(0):
            row = gives[k].row
            if allowed[row] < 0:
                allowed[row] = claim(samples, owners, row, equipment, time_ns[i], longest_ns)
            if not allowed[row]:
                continue
            mask, worth = gives[k].mask, status[i]
            said = float(int(words[i]) >> gives[k].shift & mask) if mask else value[i] * gives[k].scale
            if gives[k].from_ellipsoid:
                said -= geoid.undulation_m
                old = geoid.status == NORMAL and time_ns[i] >= geoid.stale_from_ns
                worth = max(worth, np.uint8(STALE if old else geoid.status))
            put(samples, row, time_ns[i], said, worth)


@njit(cache=True)
def claim(samples, owners, row, equipment, time_ns, longest_ns):  # type: ignore[no-untyped-def] # typed by Aircraft
    """Whether an equipment may give a quantity from some time on: only one does, until it has been silent for long."""
    if owners[row] not in (NOBODY, equipment):
        end = samples.end[row]
        if end and time_ns - samples.time_ns[row, end - 1] <= longest_ns[row]:
            return False
        samples.end[row] = 0
    owners[row] = equipment
    return True


@njit(cache=True)
def own_words(  # type: ignore[no-untyped-def] # typed by Aircraft
    time_ns, words, label, status, has_sdi, in_order, source, last_ns, own
):
    """Mark in `own` (n,) the words that are not of another source than the one in use, 0 if none was heard yet.

    Words to all (SDI 0), words without an SDI and damaged ones, whose SDI says nothing, are of every source. Gives
    which of them have a label of `in_order`, the source (SDI) in use, when it was last heard, and which others were
    left out: bit 4 n + m for words of m while n was in use.
    """
    others, count, ordered = 0, 0, np.empty(words.size, np.int64)
    for i in range(words.size):
        named = has_sdi[label[i]] and status[i] != BAD_PARITY
        sdi = int(words[i]) >> 8 & 3 if named else 0
        if sdi and (not source or (sdi != source and time_ns[i] - last_ns > SILENT_NS)):
            source = sdi
        own[i] = sdi in (0, source)
        if sdi and own[i]:
            last_ns = time_ns[i]
        elif sdi:
            others |= 1 << 4 * source + sdi
        if own[i] and in_order[label[i]]:
            ordered[count] = i
            count += 1
    return ordered[:count], source, last_ns, others
