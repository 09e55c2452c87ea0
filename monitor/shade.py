"""SHADE: shadow detection and extraction, the two state machines, the shadows and the pairs.

Young, Uijt de Haag and Campbell (2004), equations (2) to (5), Table 1 and (9). Bins are numbered 1..M. An edge is the
non-zero bin beside the zeros: front F is the last lit bin before a shadow, back B the first lit bin after it, the size
is B - F - 1 and the centre C = (F + B) / 2, halves kept.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

RADAR_INITIAL, RADAR_LIT, RADAR_SHADOW = -3, 1, 0  # states A, B, C
DEM_INITIAL, DEM_LIT, DEM_PEAK, DEM_SHADOW = -3, 1, 2, 0  # states D, E, F, G

SHADOW = np.dtype(
    [
        ("radial", "i4"),
        ("front", "i4"),
        ("back", "i4"),
        ("centre", "f8"),
        ("size", "i4"),
        ("range_limited", "?"),
    ]
)
PAIR = np.dtype([("radial", "i4"), ("radar", "i4"), ("dem", "i4"), ("overlap", "i4")])


def radar_states(bins: NDArray[np.uint8]) -> NDArray[np.int8]:
    """States of the radar thread, eq. (2): -3 until the first lit bin, then 1 where lit and 0 where not.

    `bins` is (n, M), any level above 0 being lit; the result is i1 (n, M).
    """
    return _radar_states(np.atleast_2d(np.asarray(bins)))


def dem_states(delta: NDArray[np.float64], dmin: ArrayLike, dmax: ArrayLike) -> NDArray[np.int8]:
    """States of the terrain thread, eqs. (4) and (5) and Table 1, i1 (n, M): -3, 1 lit, 2 lit peak, 0 shadow.

    `delta` (n, M) is the tangent -(h_W - h_j) / R_j of each bin; `dmin` and `dmax`, scalars or (n,), are the *tangents*
    of the beam's lower and upper edge.
    """
    d = np.atleast_2d(np.asarray(delta, np.float64))
    low = np.broadcast_to(np.asarray(dmin, np.float64), d.shape[:1])
    high = np.broadcast_to(np.asarray(dmax, np.float64), d.shape[:1])
    return _dem_states(d, low, high)


def shadows(states: NDArray[np.int8], thread: str, min_size: int = 1, max_size: int | None = None) -> NDArray[np.void]:
    """Shadows on each radial, in order of radial and range: a structured array of `SHADOW`.

    A shadow that runs to the last bin ends there by definition (B = M, size = M - F) and is flagged range-limited.
    `thread` is "radar" or "dem". Sizes are in bins, both limits included.
    """
    if thread not in ("radar", "dem"):
        raise ValueError(f'thread is "radar" or "dem", not {thread!r}')
    return _shadows(np.atleast_2d(states), min_size, states.shape[-1] if max_size is None else max_size)


@njit(cache=True)
def _radar_states(bins: NDArray[np.uint8]) -> NDArray[np.int8]:
    out = np.empty(bins.shape, np.int8)
    for i in range(bins.shape[0]):
        for j in range(bins.shape[1]):  # with no state to carry, many bins at a time
            out[i, j] = RADAR_LIT if bins[i, j] > 0 else RADAR_SHADOW
        first = 0
        while first < bins.shape[1] and bins[i, first] == 0:
            out[i, first] = RADAR_INITIAL
            first += 1
    return out


@njit(cache=True)
def _dem_states(delta: NDArray[np.float64], dmin: NDArray[np.float64], dmax: NDArray[np.float64]) -> NDArray[np.int8]:
    out = np.full(delta.shape, DEM_INITIAL, np.int8)
    for i in range(delta.shape[0]):
        walk(delta[i], dmin[i], dmax[i], out[i])
    return out


@njit(cache=True)
def walk(delta: NDArray[np.float64], dmin: float, dmax: float, out: NDArray[np.int8]) -> None:
    """Table 1 along one radial; a bin of `out` is raised to its state, so that the rays of a fan join in one array.

    The stored peak is the highest tangent so far, which hides what is not above it. One above the beam, which nothing
    in the beam exceeds, hides the rest. A bin as high as a lit one before it is lit: their edge is a plateau.
    """
    n = delta.size
    top = dmin
    lit = False
    first = n  # above dmin
    for j in range(n):
        d = delta[j]
        if d > top:
            top = d
            lit = d <= dmax
            first = min(first, j)
        elif d < top:
            lit = False
        if lit:
            following = delta[j + 1] if j + 1 < n else d
            out[j] = max(out[j], DEM_PEAK if (following < d) | (following > dmax) else DEM_LIT)
    behind = out[first:]
    for j in range(behind.size):  # with no state to carry, many bins at a time
        behind[j] = max(behind[j], DEM_SHADOW)


@njit(cache=True)
def _shadows(states: NDArray[np.int8], min_size: int, max_size: int) -> NDArray[np.void]:
    bins = states.shape[1]
    found = []
    for i in range(states.shape[0]):
        front = 0
        for j in range(1, bins + 1):
            if states[i, j - 1] > 0:
                if front and j - front > 1:
                    found.append((i, front, j, j - front - 1, False))
                front = j
        # A shadow open at the end needs a front edge, or the blocked beam of state G that never was lit has none.
        if front and front < bins:
            found.append((i, front, bins, bins - front, True))
    found = [shadow for shadow in found if min_size <= shadow[3] <= max_size]
    out = np.empty(len(found), SHADOW)
    for k in range(len(found)):
        s = out[k]
        s.radial, s.front, s.back, s.size, s.range_limited = found[k]
        s.centre = (s.front + s.back) / 2
    return out


@njit(cache=True)
def last_dark(s: Any) -> Any:
    """The last dark bin of a shadow."""
    return s.back if s.range_limited else s.back - 1


@njit(cache=True)
def pair(radar_shadows: Any, dem_shadows: Any) -> NDArray[np.void]:
    """At most one pair per radial: the largest overlap in bins, then the longer shadows, then the nearer.

    Range-limited shadows pair only with range-limited ones. Both inputs are ordered by radial, as `shadows` gives them;
    `radar` and `dem` of the result are indices into them.
    """
    found = []
    start = 0
    k = 0
    while k < radar_shadows.size:
        radial = radar_shadows[k].radial
        while start < dem_shadows.size and dem_shadows[start].radial < radial:
            start += 1
        best = (0, 0, 0)  # overlap, joint size, minus the nearer front
        pick = (-1, -1)
        while k < radar_shadows.size and radar_shadows[k].radial == radial:
            r = radar_shadows[k]
            m = start
            while m < dem_shadows.size and dem_shadows[m].radial == radial:
                d = dem_shadows[m]
                if r.range_limited == d.range_limited:
                    overlap = min(last_dark(r), last_dark(d)) - max(r.front, d.front)
                    rank = (overlap, last_dark(r) - r.front + last_dark(d) - d.front, -min(r.front, d.front))
                    if overlap > 0 and (pick[0] < 0 or rank > best):
                        best, pick = rank, (k, m)
                m += 1
            k += 1
        if pick[0] >= 0:
            found.append((radial, pick[0], pick[1], best[0]))
    out = np.empty(len(found), PAIR)
    for k in range(len(found)):
        p = out[k]
        p.radial, p.radar, p.dem, p.overlap = found[k]
    return out


def pair_first(radar_shadows: NDArray[np.void], dem_shadows: NDArray[np.void]) -> NDArray[np.void]:
    """The first shadow on each radial against the first, overlapping or not: as in the calibration of section 3.

    Inputs and result as those of `pair`; `overlap` is 0 for two that lie apart.
    """
    radial, r, d = np.intersect1d(radar_shadows["radial"], dem_shadows["radial"], return_indices=True)
    ends = [found["back"] - ~found["range_limited"] for found in (radar_shadows[r], dem_shadows[d])]
    overlap = np.minimum(*ends) - np.maximum(radar_shadows["front"][r], dem_shadows["front"][d])
    out = np.empty(len(radial), PAIR)
    out["radial"], out["radar"], out["dem"], out["overlap"] = radial, r, d, np.maximum(overlap, 0)
    return out


@njit(cache=True)
def _any_lit(states: NDArray[np.int8]) -> bool:
    j = 0
    while j < states.size and states[j] <= 0:
        j += 1
    return j < states.size


@njit(cache=True)
def unmatched_share(
    mine: Any, others: Any, other_states: NDArray[np.int8], min_overlap: float = 0.5
) -> tuple[int, int]:
    """How many of one thread's eligible shadows have no partner, and how many are eligible.

    Eligible are the shadows that lie wholly beyond the other thread's first lit bin and outside its range-limited
    shadow; a partner overlaps by at least `min_overlap` of intersection over union.
    """
    unmatched = eligible = start = 0
    for s in mine:
        end = last_dark(s)
        if s.range_limited or not _any_lit(other_states[s.radial, : s.front]):
            continue
        while start < others.size and others[start].radial < s.radial:
            start += 1
        matched = hidden = False
        m = start
        while m < others.size and others[m].radial == s.radial:
            o = others[m]
            overlap = min(end, last_dark(o)) - max(s.front, o.front)
            matched |= overlap >= min_overlap * (max(end, last_dark(o)) - min(s.front, o.front))
            hidden |= o.range_limited and end > o.front
            m += 1
        eligible += not hidden
        unmatched += not (hidden or matched)
    return unmatched, eligible
