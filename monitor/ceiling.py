"""Ceilings of the ground: how far ahead of the antenna a beam surely passes over everything, without a look at it.

Bilinear ground is never higher than the highest post around it. Where every ceiling so far lies below the line of the
beam's lower edge, so does the ground of every bin in reach: a bin's ground is found at a distance that differs from its
triangle's by at most a tolerance, on which the line counts, and never beyond its slant range. (A search that ends at
its most looks short of that would need posts side by side that differ by kilometres.) No state depends on such a bin.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor.geodesy import Ray, along, bend

BLOCK = 4  # posts: with eight a third fewer bins are left out, with two more is spent than saved
NEAR = BLOCK - 1.01  # a cell fewer than a block: ground within so many posts of a place has its posts in the nine
ROUNDING_M = 0.001  # far more than rounding can lift a ground or a line


def ceilings(height_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """The highest post of each block and the eight around it, NaN if one of theirs is void; none for blocks on the rim.

    Block (i, j) of `BLOCK` by `BLOCK` posts is element (i - 1, j - 1).
    """
    rows, columns = (size // BLOCK for size in height_m.shape)
    if min(rows, columns) < 3:
        return np.empty((0, 0), np.float32)
    tops = np.maximum.reduce([height_m[k : rows * BLOCK : BLOCK] for k in range(BLOCK)])
    tops = np.maximum.reduce([tops[:, k : columns * BLOCK : BLOCK] for k in range(BLOCK)])
    tops = np.maximum(np.maximum(tops[:-2], tops[1:-1]), tops[2:])
    return np.ascontiguousarray(np.maximum(np.maximum(tops[:, :-2], tops[:, 1:-1]), tops[:, 2:]))


@njit(cache=True, error_model="numpy")
def clear_m(
    ceiling_m: NDArray[np.float32], track: Ray, height_m: float, tangent: float, tolerance_m: float, farthest_m: float
) -> float:
    """The distance up to which all ground on a ray in posts is seen from `height_m` under a lower `tangent`.

    That holds for ground at s were it anywhere within `tolerance_m` of s. No post up to there is void or missing.
    Stretches are tried in turn, so long that their ends lie within `NEAR` posts of the middle.
    """
    steepest = max(abs(track.lat1), abs(track.lon1))
    half = NEAR / (steepest + bend(track, farthest_m + NEAR / steepest))
    s = 0.0
    while s < farthest_m:
        row, column = along(track, s + half)
        i, j = np.floor(row / BLOCK) - 1, np.floor(column / BLOCK) - 1
        if not ((0 <= i < ceiling_m.shape[0]) & (0 <= j < ceiling_m.shape[1])):
            break
        end = s + 2 * half
        line = min(tangent * (s - tolerance_m), tangent * (end + tolerance_m))
        if not ceiling_m[np.uint32(i), np.uint32(j)] < height_m + line - ROUNDING_M:
            break
        s = end
    return s
