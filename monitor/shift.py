"""The shift statistic: do the disparities of a scan follow a horizontal shift of the terrain against the aircraft?

Terrain that is stored a vector b off its place is seen nearer or farther by the part of b along each radial, so
disparities follow the cosine of the azimuth. Two components of all pairs together stand out of their scatter where
their squares, each by itself, do not: this sees shifts that Q does not see yet.

Of the disparities, clipped as for Q, g = sum(z a) is the score of b, where a is the unit vector of a radial, north and
east. When nothing is wrong its covariance is sigma^2 M + s^2 M^2 with M = sum(a a'): the scatter of each pair, and an
error s of the position that all pairs of a scan have in common. S = g' (sigma^2 M + s^2 M^2)^-1 g is then chi-square
with two degrees of freedom.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from monitor.disparity import clipped

LARGEST_BINS = 64.0  # a common error beyond it is none that any receiver has
HALVINGS = 40
LEAST_INFORMATION = 1e-9  # of a direction, beside the other: radials all at one azimuth say nothing across it


def shift_statistic(
    disparities: NDArray[np.float64],
    azimuth_rad: NDArray[np.float64],
    median: float,
    clip: float,
    sigma: float,
    common: float,
) -> float:
    """S, dimensionless, of disparities (N,) on radials at true azimuths (N,); all else in range bins like these."""
    z = clipped(disparities, median, clip)
    a = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    information, axes = np.linalg.eigh(a @ a.T)
    score = axes.T @ (a @ z)
    known = information > LEAST_INFORMATION * information[-1]
    variance = sigma**2 * information + common**2 * information**2
    return float(np.sum(score[known] ** 2 / variance[known]))


def shift_threshold(p_fa: float) -> float:
    """What S exceeds with probability p_fa when nothing is wrong."""
    return float(chdtri(2, p_fa))


def common_error(
    scans: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]], median: float, clip: float, sigma: float
) -> float:
    """The common error s, range bins, with which the mean of S over fault-free scans is 2, as of chi-square.

    Each scan is its disparities and their azimuths, (N,) each. 0 where the scatter of the pairs explains all.
    """
    low, high = 0.0, LARGEST_BINS
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        mean = np.mean([shift_statistic(d, azimuth, median, clip, sigma, middle) for d, azimuth in scans])
        low, high = (middle, high) if mean > 2 else (low, middle)
    return high if low else 0.0
