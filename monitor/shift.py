"""The shift statistic: do the disparities of a scan follow a horizontal shift of the terrain against the aircraft?

Terrain that is stored a vector b off its place is seen nearer or farther by the part of b along each radial, so
disparities follow the cosine of the azimuth. Two components of all pairs together stand out of their scatter where
their squares, each by itself, do not: this sees shifts that Q does not see yet.

Of the disparities z, clipped as for Q, g = sum(z a) is the score of b, where a is the unit vector of a radial, north
and east. When nothing is wrong its covariance is

    V = sigma^2 M + s^2 M^2 + t^2 u u'    with    M = sum(a a'),  u = sum(w a):

the scatter of each pair, an error s of the position that all pairs of a scan have in common, and one of the height,
which makes all shadows longer or shorter, and so moves all centres by a share t of their sizes w. S = g' V^-1 g is then
chi-square with two degrees of freedom.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor.calibration import CommonErrors
from monitor.disparity import clipped
from monitor.sample import ScanSample

LARGEST_BINS = 64.0  # a common error beyond it is none that any receiver has
HALVINGS = 40
LEAST_INFORMATION = 1e-9  # of a direction, beside the other: radials all at one azimuth say nothing across it


class Score(NamedTuple):
    """What a scan says of a shift, north and east, and of a common stretch of its shadows. Made by `score`."""

    shift: NDArray[np.float64]  # g (2,)
    information: NDArray[np.float64]  # M (2, 2)
    mixing: NDArray[np.float64]  # u (2,)
    stretch: float  # sum(w z)
    stretch_information: float  # sum(w^2)


class MeanShift(NamedTuple):
    """A shift north and east in range bins (2,), its standard errors, and its chi-square of two degrees of freedom."""

    bins: NDArray[np.float64]
    stderr_bins: NDArray[np.float64]
    statistic: float


def score(sample: ScanSample, median: float, clip: float) -> Score:
    """Sums over the pairs of a sample, about a median and clipped, in range bins."""
    z = clipped(sample.disparities, median, clip)
    a = np.stack([np.cos(sample.azimuth_rad), np.sin(sample.azimuth_rad)])
    w = sample.size
    return Score(a @ z, a @ a.T, a @ w, float(w @ z), float(w @ w))


def shift_statistic(found: Score, sigma: float, common: CommonErrors) -> float:
    """S, dimensionless, of pairs that scatter by sigma range bins and have those errors in common."""
    m = found.information
    covariance = sigma**2 * m + common.place_bins**2 * m @ m
    covariance += common.stretch**2 * np.outer(found.mixing, found.mixing)
    return float(found.shift @ np.linalg.pinv(covariance, LEAST_INFORMATION, hermitian=True) @ found.shift)


def shift_threshold(p_fa: float) -> float:
    """What S exceeds with probability p_fa when nothing is wrong: of two degrees of freedom, -2 ln(p_fa)."""
    return -2 * math.log(p_fa)


def common_errors(scans: Sequence[Score], sigma: float) -> CommonErrors:
    """The errors in common of fault-free scans whose pairs scatter by sigma range bins.

    The stretch is what the scatter of the pairs does not explain of how disparities go with sizes, from scan to scan;
    the error of the position is the one with which the mean of S is 2, as of chi-square. Either is 0 where the scatter
    explains all.
    """
    spare = [(s.stretch / s.stretch_information) ** 2 - sigma**2 / s.stretch_information for s in scans]
    stretch = math.sqrt(max(0.0, float(np.mean(spare))))
    low, high = 0.0, LARGEST_BINS
    for _ in range(HALVINGS):
        middle = CommonErrors(place_bins=(low + high) / 2, stretch=stretch)
        mean = np.mean([shift_statistic(scan, sigma, middle) for scan in scans])
        low, high = (middle.place_bins, high) if mean > 2 else (low, middle.place_bins)
    return CommonErrors(place_bins=high if low else 0.0, stretch=stretch)


def mean_shift(scans: Sequence[Score]) -> MeanShift:
    """The shift that scans have in common, and how certain it is by how much they differ among each other."""
    shifts, information = (np.array(column) for column in zip(*((s.shift, s.information) for s in scans), strict=True))
    inverse = np.linalg.pinv(information.sum(axis=0), LEAST_INFORMATION, hermitian=True)
    bins = inverse @ shifts.sum(axis=0)
    left = (shifts - information @ bins) @ inverse  # what each scan would move the mean by
    covariance = left.T @ left * len(scans) / max(len(scans) - 1, 1)
    certainty = np.linalg.pinv(covariance, LEAST_INFORMATION, hermitian=True)
    return MeanShift(bins, np.sqrt(np.diag(covariance)), float(bins @ certainty @ bins))
