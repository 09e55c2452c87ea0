"""SHADE: shadow detection and extraction, the two state machines, the shadows and the pairs.

Young, Uijt de Haag and Campbell (2004), equations (2) to (5), Table 1 and (9). Bins are numbered 1..M. An edge is the
non-zero bin beside the zeros: front F is the last lit bin before a shadow, back B the first lit bin after it, the size
is B - F - 1 and the centre C = (F + B) / 2, halves kept.
"""

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
    found = _shadows(np.atleast_2d(states))
    out = np.zeros(len(found), SHADOW)
    out["radial"], out["front"], out["back"], out["size"], out["range_limited"] = found.T
    out["centre"] = (out["front"] + out["back"]) / 2
    return out[(out["size"] >= min_size) & (out["size"] <= (max_size if max_size is not None else states.shape[-1]))]


def pair(radar_shadows: NDArray[np.void], dem_shadows: NDArray[np.void]) -> NDArray[np.void]:
    """At most one pair per radial: the largest overlap in bins, then the longer shadows, then the nearer.

    Range-limited shadows pair only with range-limited ones. Both inputs are ordered by radial, as `shadows` gives them;
    `radar` and `dem` of the result are indices into them.
    """
    found = _pair(*_columns(radar_shadows), *_columns(dem_shadows))
    out = np.zeros(len(found), PAIR)
    out["radial"], out["radar"], out["dem"], out["overlap"] = found.T
    return out


def _columns(s: NDArray[np.void]) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.bool_]]:
    return (
        np.ascontiguousarray(s["radial"]),
        np.ascontiguousarray(s["front"]),
        np.ascontiguousarray(s["back"]),
        np.ascontiguousarray(s["range_limited"]),
    )


def unmatched_share(
    mine: NDArray[np.void], others: NDArray[np.void], other_states: NDArray[np.int8], min_overlap: float = 0.5
) -> tuple[int, int]:
    """How many of one thread's eligible shadows have no partner, and how many are eligible.

    Eligible are the shadows that lie wholly beyond the other thread's first lit bin and outside its range-limited
    shadow; a partner overlaps by at least `min_overlap` of intersection over union.
    """
    lit = other_states > 0
    first_lit = np.where(lit.any(axis=1), lit.argmax(axis=1) + 1, other_states.shape[1] + 1)
    limit = np.full(len(other_states), other_states.shape[1])
    tail = others[others["range_limited"]]
    limit[tail["radial"]] = tail["front"]
    unmatched, eligible = _unmatched(*_columns(mine), *_columns(others), first_lit, limit, min_overlap)
    return unmatched, eligible


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
def _shadows(states: NDArray[np.int8]) -> NDArray[np.int32]:
    bins = states.shape[1]
    found = []
    for i in range(states.shape[0]):
        front = 0
        for j in range(1, bins + 1):
            if states[i, j - 1] > 0:
                if front and j - front > 1:
                    found.append((i, front, j, j - front - 1, 0))
                front = j
        # A shadow open at the end needs a front edge, or the blocked beam of state G that never was lit has none.
        if front and front < bins:
            found.append((i, front, bins, bins - front, 1))
    out = np.empty((len(found), 5), np.int32)
    for k in range(len(found)):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = found[k]
    return out


@njit(cache=True, inline="always")
def _last_dark(back: int, limited: bool) -> int:
    return back if limited else back - 1


@njit(cache=True)
def _pair(  # type: ignore[no-untyped-def] # eight columns, typed in _columns
    r_radial, r_front, r_back, r_limited, d_radial, d_front, d_back, d_limited
):
    found = []
    start = 0
    k = 0
    while k < r_radial.size:
        radial = r_radial[k]
        while start < d_radial.size and d_radial[start] < radial:
            start += 1
        best = (0, 0, 0)  # overlap, joint size, minus the nearer front
        pick = (-1, -1)
        while k < r_radial.size and r_radial[k] == radial:
            m = start
            while m < d_radial.size and d_radial[m] == radial:
                if r_limited[k] == d_limited[m]:
                    r_end, d_end = _last_dark(r_back[k], r_limited[k]), _last_dark(d_back[m], d_limited[m])
                    overlap = min(r_end, d_end) - max(r_front[k], d_front[m])
                    rank = (overlap, r_end - r_front[k] + d_end - d_front[m], -min(r_front[k], d_front[m]))
                    if overlap > 0 and (pick[0] < 0 or rank > best):
                        best, pick = rank, (k, m)
                m += 1
            k += 1
        if pick[0] >= 0:
            found.append((radial, pick[0], pick[1], best[0]))
    out = np.empty((len(found), 4), np.int32)
    for k in range(len(found)):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = found[k]
    return out


@njit(cache=True)
def _unmatched(  # type: ignore[no-untyped-def] # eight columns, typed in _columns
    m_radial, m_front, m_back, m_limited, o_radial, o_front, o_back, o_limited, first_lit, limit, min_overlap
):
    unmatched = eligible = 0
    start = 0
    for k in range(m_radial.size):
        radial = m_radial[k]
        end = _last_dark(m_back[k], m_limited[k])
        if m_limited[k] or m_front[k] < first_lit[radial] or end > limit[radial]:
            continue
        eligible += 1
        while start < o_radial.size and o_radial[start] < radial:
            start += 1
        matched = False
        m = start
        while m < o_radial.size and o_radial[m] == radial:
            other_end = _last_dark(o_back[m], o_limited[m])
            overlap = min(end, other_end) - max(m_front[k], o_front[m])
            union = max(end, other_end) - min(m_front[k], o_front[m])
            matched |= overlap >= min_overlap * union
            m += 1
        unmatched += not matched
    return unmatched, eligible
