"""How far the shadows of one thread lie from those of a reference: edges, centres and sizes, and how they scatter.

Young, Uijt de Haag and Campbell (2004), sections 2 and 3, Tables 3 and 5. A residual is measured minus reference, in
range bins. Shadows that run to the last bin have no back edge and take no part.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import normaltest

from monitor.shade import pair, shadows

Pairing = Literal["overlap", "first"]

NORMALITY_TEST = "D'Agostino and Pearson's K^2, of skewness and kurtosis"
LEAST_FOR_NORMALITY = 20  # below which the distribution of K^2 is not that of its tables


class Residuals(NamedTuple):
    """Front and back edges of shadows that both threads have, measured minus reference: arrays (N,), range bins."""

    front: NDArray[np.float64]
    back: NDArray[np.float64]

    @property
    def centre(self) -> NDArray[np.float64]:
        """Of the centres, eq. (9)."""
        return (self.front + self.back) / 2

    @property
    def size(self) -> NDArray[np.float64]:
        """Of the sizes B - F - 1."""
        return self.back - self.front


class Moments(NamedTuple):
    """Of some residuals: their number, mean and standard deviation in range bins; None of too few."""

    n: int
    mean: float | None
    sigma: float | None


def residuals(
    measured: NDArray[np.int8], reference: NDArray[np.int8], sizes: tuple[int, int], pairing: Pairing
) -> Residuals:
    """The residuals of whole shadows of some sizes, both included; states of both threads are i1 (n, M).

    Shadows pair by their overlap, as in flight, or the first of a radial with the first, as in the paper's section 3.
    """
    seen, true = whole(measured, sizes), whole(reference, sizes)
    if pairing == "first":
        seen, true = _first(seen), _first(true)
        _, i, k = np.intersect1d(seen["radial"], true["radial"], assume_unique=True, return_indices=True)
    else:
        pairs = pair(seen, true)
        i, k = pairs["radar"], pairs["dem"]
    front, back = (np.subtract(seen[edge][i], true[edge][k], dtype=np.float64) for edge in ("front", "back"))
    return Residuals(front, back)


def moments(values: NDArray[np.float64]) -> Moments:
    """Number, mean and standard deviation, with N - 1 in the denominator."""
    n = len(values)
    return Moments(n, float(np.mean(values)) if n else None, float(np.std(values, ddof=1)) if n > 1 else None)


def normality(values: NDArray[np.float64]) -> float | None:
    """The p value of `NORMALITY_TEST`: how often normal residuals would look no more normal; None of too few."""
    if len(values) < LEAST_FOR_NORMALITY or not np.ptp(values):
        return None
    return float(normaltest(values).pvalue)


def correlation(r: Residuals) -> float | None:
    """Between front and back edges, which eq. (11) takes to be 0; None of too few, or where an edge never moves."""
    if len(r.front) < 2 or not np.ptp(r.front) or not np.ptp(r.back):
        return None
    return float(np.corrcoef(r.front, r.back)[0, 1])


def sigma_of_independent_edges(r: Residuals) -> float | None:
    """The standard deviation of the centres if front and back edges were independent, eq. (11), range bins."""
    front, back = moments(r.front).sigma, moments(r.back).sigma
    return None if front is None or back is None else float(np.hypot(front, back)) / 2


def whole(states: NDArray[np.int8], sizes: tuple[int, int]) -> NDArray[np.void]:
    """The shadows of a thread that have both edges, of some sizes."""
    found = shadows(states, "dem", *sizes)  # lit is above zero in both threads
    kept: NDArray[np.void] = found[~found["range_limited"]]
    return kept


def _first(found: NDArray[np.void]) -> NDArray[np.void]:
    kept: NDArray[np.void] = found[np.diff(found["radial"], prepend=-1) > 0]
    return kept
