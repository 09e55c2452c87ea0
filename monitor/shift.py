"""The shift statistic: do the disparities of a scan follow a horizontal shift of the terrain against the aircraft?

Terrain that is stored a vector b off its place is seen nearer or farther by the part of b along each radial, so
disparities follow the cosine of the azimuth. Two components of all pairs together stand out of their scatter where
their squares, each by itself, do not: this sees shifts that Q does not see yet.

Often one edge of a shadow only is where it should be, as where two shadows have become one; the centre is then far off.
So the edges are clipped, each by itself: z is the mean of both, about their medians. g = sum(z a) is the score of b,
where a is the unit vector of a radial, north and east. When nothing is wrong its covariance is

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

from monitor.calibration import EdgeModel, ShiftModel
from monitor.disparity import clipped
from monitor.sample import ScanSample

LARGEST_BINS = 64.0  # a common error beyond it is none that any receiver has
HALVINGS = 40
DIRECTIONS = 8  # of a half circle, in which a shift is tried
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


def score(sample: ScanSample, front: EdgeModel, back: EdgeModel) -> Score:
    """Sums over the pairs of a sample, in range bins."""
    z = clipped_centres(sample, front, back)
    a, w = _towards(sample), sample.size
    return Score(a @ z, a @ a.T, a @ w, float(w @ z), float(w @ w))


def clipped_centres(sample: ScanSample, front: EdgeModel, back: EdgeModel) -> NDArray[np.float64]:
    """The disparities (N,) that the edges of shadows have about their medians, each edge clipped; range bins."""
    fronts = clipped(sample.front, front.median_bins, front.clip_bins)
    return (fronts + clipped(sample.back, back.median_bins, back.clip_bins)) / 2


def _towards(sample: ScanSample) -> NDArray[np.float64]:
    """North and east of each pair's radial (2, N)."""
    return np.stack([np.cos(sample.azimuth_rad), np.sin(sample.azimuth_rad)])


def shift_statistic(found: Score, model: ShiftModel) -> float:
    """S, dimensionless, of pairs that scatter and err in common as the model says."""
    return float(_statistics(found.shift, found.information, found.mixing, model))


def _statistics(
    g: NDArray[np.float64], m: NDArray[np.float64], u: NDArray[np.float64], model: ShiftModel
) -> NDArray[np.float64]:
    """S of each g (..., 2), M (..., 2, 2) and u (..., 2)."""
    covariance = model.sigma_bins**2 * m + model.place_bins**2 * m @ m
    covariance += model.stretch**2 * (u[..., :, None] * u[..., None, :])
    inverse = np.linalg.pinv(covariance, LEAST_INFORMATION, hermitian=True)
    return np.asarray(g[..., None, :] @ inverse @ g[..., :, None])[..., 0, 0]


def largest_statistic(sample: ScanSample, model: ShiftModel) -> float:
    """What S comes to, of several directions at the most, for a shift that clips every pair of a sample."""
    clip = (model.front.clip_bins + model.back.clip_bins) / 2
    a, found = _towards(sample), score(sample, model.front, model.back)
    angles = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    towards = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return float(_statistics(clip * np.sign(towards @ a) @ a.T, found.information, found.mixing, model).max())


def shift_threshold(p_fa: float) -> float:
    """What S exceeds with probability p_fa when nothing is wrong: of two degrees of freedom, -2 ln(p_fa)."""
    return -2 * math.log(p_fa)


def with_common_errors(bare: ShiftModel, scans: Sequence[Score]) -> ShiftModel:
    """The model with the errors in common that fault-free scans have whose pairs scatter as it says.

    The stretch is what the scatter of the pairs does not explain of how disparities go with sizes, from scan to scan;
    the error of the position is the one with which the mean of S is 2, as of chi-square. Either is 0 where the scatter
    explains all.
    """
    variance = bare.sigma_bins**2
    spare = [(s.stretch / s.stretch_information) ** 2 - variance / s.stretch_information for s in scans]
    stretch = math.sqrt(max(0.0, float(np.mean(spare))))

    g, m, u = (np.array(column) for column in zip(*((s.shift, s.information, s.mixing) for s in scans), strict=True))

    def erring(place_bins: float) -> ShiftModel:
        return bare.model_copy(update={"place_bins": place_bins, "stretch": stretch})

    low, high = 0.0, LARGEST_BINS
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        mean = np.mean(_statistics(g, m, u, erring(middle)))
        low, high = (middle, high) if mean > 2 else (low, middle)
    return erring(high if low else 0.0)


def mean_shift(scans: Sequence[Score]) -> MeanShift:
    """The shift that scans have in common, and how certain it is by how much they differ among each other."""
    shifts, information = (np.array(column) for column in zip(*((s.shift, s.information) for s in scans), strict=True))
    inverse = np.linalg.pinv(information.sum(axis=0), LEAST_INFORMATION, hermitian=True)
    bins = inverse @ shifts.sum(axis=0)
    left = (shifts - information @ bins) @ inverse  # what each scan would move the mean by
    covariance = left.T @ left * len(scans) / max(len(scans) - 1, 1)
    certainty = np.linalg.pinv(covariance, LEAST_INFORMATION, hermitian=True)
    return MeanShift(bins, np.sqrt(np.diag(covariance)), float(bins @ certainty @ bins))
