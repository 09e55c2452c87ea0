"""How far across the radials a shadow reaches: wide ones are likelier to be seen by both threads.

Young, Uijt de Haag and Campbell (2004), section 4 (a).
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor.shade import last_dark
from monitor.track import wrap

GAP = 1.5  # usual steps between two radials that are still neighbours: one that is left out between them parts them


def are_wide(
    found: NDArray[np.void], scan_angle_deg: NDArray[np.float64], spacing_deg: float, minimum_deg: float
) -> NDArray[np.bool_]:
    """Which shadows (k,) reach across at least `minimum_deg` with those of neighbouring radials that overlap them.

    `found` is ordered as `shadows` gives it, its radials are those of `scan_angle_deg` (n,) in order of arrival. The
    width is the angle from the first to the last radial of an unbroken row of radials with a shadow that shares a range
    bin with this one: the least that the shadow can be wide, 0 if no neighbour has one.
    """
    steps = np.abs(wrap(np.diff(scan_angle_deg)))
    known = steps[np.isfinite(steps)]
    usual = max(spacing_deg, float(np.median(known)) if known.size else 0.0)
    steps = np.where(steps <= GAP * usual, steps, np.inf)  # of an angle that is not known, too
    begins = np.searchsorted(found["radial"], np.arange(len(scan_angle_deg) + 1))
    return _are_wide(found, begins, steps, minimum_deg)


@njit(cache=True)
def _are_wide(
    found: Any, begins: NDArray[np.int64], steps_deg: NDArray[np.float64], minimum_deg: float
) -> NDArray[np.bool_]:
    wide = np.empty(found.size, np.bool_)
    for k in range(found.size):
        width = 0.0
        for way in (-1, 1):
            at = found[k].radial
            while width < minimum_deg and 0 <= at + way < begins.size - 1:
                step = steps_deg[min(at, at + way)]
                at += way
                if np.isinf(step) or not _overlapped(found, begins[at], begins[at + 1], found[k]):
                    break
                width += step
        wide[k] = width >= minimum_deg
    return wide


@njit(cache=True)
def _overlapped(found: Any, first: int, end: int, shadow: Any) -> bool:
    """Whether one of the shadows of a radial, which lie apart and in order, shares a bin with another's."""
    low, high = first, end
    while low < high:  # the first that reaches beyond the front
        middle = (low + high) // 2
        if last_dark(found[middle]) > shadow.front:
            high = middle
        else:
            low = middle + 1
    return low < end and found[low].front < last_dark(shadow)
