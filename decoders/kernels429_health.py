"""The loops behind `decoders.health429`: words counted by label, and what each second of them says.

What begins a finding and what ends it lie apart, so that nothing on the edge is told every second.
"""

from typing import Final

import numpy as np
from numba import njit

from decoders.results429 import Status

EQUIPMENT: Final = 0o377  # the label that says which box sends
NORMAL: Final = int(Status.NORMAL)
BAD_PARITY: Final = int(Status.BAD_PARITY)
FAST, SLOW, STOPPED = 1, 2, 4  # what may be told of a label's rate
TOO_FAST: Final = (0.75, 0.9)  # of the shortest interval, on average between the words of a second or more
TOO_SLOW: Final = (1.25, 1.1)  # of the longest
TOO_SILENT: Final = 3.0  # of the longest
SILENT_MS: Final = 1000.0  # and this at least
OFTEN: Final = 3  # words of a label before its silence means anything: a damaged label passes the parity too


@njit(cache=True)
def tally(  # type: ignore[no-untyped-def] # typed by health429
    start, until_ns, equipment, time_ns, words, label, value, status, has_sdi, is_known, turned,
    sources, read, first_ns, last_ns, lately, ever,
):  # fmt: skip
    """Count decoded words in rising time by label (256,) and by source (256, 4), from one on to the first after a time.

    Adds to `read` how many have a good parity, and a bad one, and of the good how many have a known label, as they are
    and if turned round. Gives where it stopped, whether that was for the time, and how many words say rightly, and how
    many wrongly, which equipment sends.
    """
    end, whole, said, before = start, False, np.zeros(2, np.int64), ever.copy()
    while end < words.size and not whole:
        of = label[end]
        if status[end] != BAD_PARITY:
            if has_sdi[of]:
                sources[of, words[end] >> 8 & 3] = True
            if of == EQUIPMENT and status[end] == NORMAL:
                said[0 if int(value[end]) & 0xFF == equipment else 1] += 1
            if not ever[of]:
                first_ns[of] = time_ns[end]
            last_ns[of] = time_ns[end]
            lately[of] += 1
            ever[of] += 1
        whole = time_ns[end] >= until_ns
        end += 1
    for of in range(256):
        count = ever[of] - before[of]
        read[0] += count
        read[2] += count * is_known[of]
        read[3] += count * is_known[turned[of]]
    read[1] += end - start - (ever - before).sum()
    return end, whole, said[0], said[1]


@njit(cache=True)
def settle(  # type: ignore[no-untyped-def] # typed by health429
    now_ns, shortest_ms, longest_ms, told, sources, first_ns, last_ns, lately, ever
):
    """End a second of tallies.

    Gives the labels of whose rate something else is to be told than was, and of each what that is, its mean interval
    and how long it has been silent, both in ms; and the labels whose words came from several sources.
    """
    flags, changed, shared = told.copy(), np.zeros(256, np.bool_), np.zeros(256, np.bool_)
    mean_ms, silent_ms = np.zeros(256), np.zeros(256)
    for of in range(256):
        shared[of] = int(sources[of, 1]) + sources[of, 2] + sources[of, 3] > 1
        sources[of] = False
        if not ever[of]:
            continue
        if lately[of] > 1 and told[of] & STOPPED:  # the gap that was told is no interval
            first_ns[of], lately[of] = last_ns[of], 1
        if lately[of] > 1:
            mean_ms[of] = (last_ns[of] - first_ns[of]) / 1e6 / (lately[of] - 1)
            shortest, longest = shortest_ms[of], longest_ms[of]
            flags[of] = _marked(flags[of], FAST, -mean_ms[of], -TOO_FAST[0] * shortest, -TOO_FAST[1] * shortest)
            flags[of] = _marked(flags[of], SLOW, mean_ms[of], TOO_SLOW[0] * longest, TOO_SLOW[1] * longest)
            first_ns[of], lately[of] = last_ns[of], 1
        silent_ms[of] = (now_ns - last_ns[of]) / 1e6
        if ever[of] >= OFTEN:
            most_ms = max(TOO_SILENT * longest_ms[of], SILENT_MS)
            flags[of] = _marked(flags[of], STOPPED, silent_ms[of], most_ms, most_ms)
        changed[of] = flags[of] != told[of]
    labels = np.flatnonzero(changed)
    return labels, flags[labels], mean_ms[labels], silent_ms[labels], np.flatnonzero(shared)


@njit(cache=True)
def _marked(flags, flag, value, wrong_above, right_below):  # type: ignore[no-untyped-def] # typed by settle
    """The flags with one of them as a value says, or as it was between the limit that begins and the one that ends."""
    return flags | flag if value > wrong_above else flags & ~flag if value <= right_below else flags
