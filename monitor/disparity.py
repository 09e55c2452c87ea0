"""The disparity statistic T, the paper's test and the robust one, thresholds and the minimum detectable bias.

Young, Uijt de Haag and Campbell (2004), equations (6) to (13) and Table 2. N T / sigma_D^2 is chi-square with N degrees
of freedom when nothing is wrong, so the threshold T_D is a quantile of chi-square and has no unit, whatever the paper's
Table 2 prints beside it: comparing T in bins^2 with T_D is wrong by the factor N / sigma_D^2.

The robust statistic Q clips each disparity before it is squared, because on real terrain the disparities have heavy
tails, and stretches the quantile by the calibrated variance factor c.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri, chndtrinc


def statistic(d: ArrayLike) -> float:
    """T of eq. (13), the mean of the squared disparities, bins^2. Raises ValueError on no disparities."""
    values = np.asarray(d, float)
    if not values.size:
        raise ValueError("T needs at least one disparity")
    return float(np.mean(values**2))


def normalised(d: ArrayLike, sigma_d: float) -> float:
    """N T / sigma_D^2, dimensionless: chi-square with N degrees of freedom when nothing is wrong."""
    return float(np.sum(np.asarray(d, float) ** 2) / sigma_d**2)


def threshold(n: float, p_fa: float) -> float:
    """T_D, dimensionless: the value that chi-square with n degrees of freedom exceeds with probability p_fa."""
    return float(chdtri(n, p_fa))


def minimum_detectable_bias(n: int, sigma_d: float, p_fa: float, p_md: float) -> float:
    """The common bias in bins that the test misses with probability p_md; sigma_d in bins."""
    if 1 - p_fa <= p_md:  # even without a bias the test alerts more often than it may miss
        return 0.0
    return sigma_d * float(np.sqrt(chndtrinc(threshold(n, p_fa), n, p_md) / n))


def clipped(d: ArrayLike, median: float, clip: float) -> NDArray[np.float64]:
    """Disparities about the calibrated median, held within +-clip bins."""
    return np.minimum(np.maximum(np.asarray(d, float) - median, -clip), clip)


def robust_statistic(d: ArrayLike, median: float, clip: float, sigma: float) -> float:
    """Q, dimensionless: the sum of squares of the clipped disparities over the calibrated variance."""
    return float(np.sum(clipped(d, median, clip) ** 2) / sigma**2)


def robust_threshold(n: int, p_fa: float, variance_factor: float) -> float:
    """What Q may reach: c times the quantile of chi-square with n / c degrees of freedom."""
    return variance_factor * threshold(n / variance_factor, p_fa)
