"""The terrain thread's own errors, by Monte Carlo: what wrong navigation, pointing and posts do to shadow edges.

Young, Uijt de Haag and Campbell (2004), section 3. Shadows are predicted once for the true state over the terrain as it
is stored, and in each run for a state with errors over posts with errors; the residuals are those of the second against
the first. The state's errors are drawn once a run, as instruments have them for longer than a scan, but that of the
azimuth for each radial, and the posts' for each post. Bins are whole numbers, as on the bus.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from monitor.geodesy import curvature_radii
from monitor.pointing import boresight
from monitor.prediction import Beam, Pointing, predict
from monitor.residuals import Pairing, Residuals, residuals, whole
from monitor.terrain import Grid

MARGIN_M = 2000.0  # that errors of position never lead out of


class Variables(NamedTuple):
    """A figure for each variable of Table 4: its value, the standard deviation of its error, or its step on the bus."""

    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    height_m: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    heading_deg: float = 0.0
    azimuth_deg: float = 0.0
    tilt_deg: float = 0.0


TABLE_4 = Variables(20e-6, 20e-6, 5.0, 0.01, 0.01, 0.01, 0.01, 0.01)
NO_STEPS = Variables()


class Setup(NamedTuple):
    """The true state, the errors, the radar and how shadows pair; `sizes` are the least and the largest, range bins.

    A step adds an error that is uniform over it: the true value lies anywhere between two steps. The radials lie all
    round from `true.azimuth_deg` on.
    """

    true: Variables
    sigma: Variables
    step: Variables
    post_noise_m: float
    bins: int
    bin_width_m: float
    beam: Beam
    sizes: tuple[int, int]
    pairing: Pairing
    seed: int
    radials: int = 360

    @property
    def reach_m(self) -> float:
        """How far the terrain is looked at."""
        return self.bins * self.bin_width_m + MARGIN_M


class Outcome(NamedTuple):
    """Of some runs: the residuals; radials on which the reference has a shadow, and those that left the terrain."""

    residuals: Residuals
    shadowed: int
    lost: int

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Several as one."""
        front, back = (np.concatenate([part.residuals[edge] for part in parts]) for edge in (0, 1))
        return cls(Residuals(front, back), sum(part.shadowed for part in parts), sum(part.lost for part in parts))


def simulate(grid: Grid, setup: Setup, runs: range) -> Outcome:
    """Some runs; a run's errors follow from the seed and its number, whatever other runs or heights there are."""
    reference, void = _thread(grid, setup, [np.zeros(1)] * len(Variables._fields))
    parts = []
    for run in runs:
        rng = np.random.default_rng((setup.seed, run))
        errors = draw_errors(rng, setup)
        noise = rng.standard_normal(grid.height_m.shape, np.float32) * np.float32(setup.post_noise_m)
        measured, left = _thread(grid.with_heights(grid.height_m + noise), setup, errors)
        stayed = ~(void | left)
        found = residuals(measured[stayed], reference[stayed], setup.sizes, setup.pairing)
        count = len(np.unique(whole(reference[stayed], setup.sizes)["radial"]))
        parts.append(Outcome(found, count, int(np.count_nonzero(~stayed))))
    return Outcome.joined(parts)


def around(grid: Grid, setup: Setup) -> Grid:
    """The part of a grid that the radar reaches: fewer posts to draw noise for. The place lies within the grid."""
    reach_m = setup.reach_m
    phi = math.radians(setup.true.latitude_deg)
    meridian, prime = curvature_radii(phi)
    high, wide = (math.degrees(reach_m / radius) for radius in (meridian, prime * math.cos(phi)))
    north = (grid.north_deg - setup.true.latitude_deg) / grid.row_deg
    east = (setup.true.longitude_deg - grid.west_deg) / grid.column_deg
    top, bottom = _cut(north, high / grid.row_deg, grid.height_m.shape[0])
    left, right = _cut(east, wide / grid.column_deg, grid.height_m.shape[1])
    return grid.with_heights(np.ascontiguousarray(grid.height_m[top:bottom, left:right]))._replace(
        north_deg=grid.north_deg - top * grid.row_deg,
        west_deg=grid.west_deg + left * grid.column_deg,
    )


def _cut(middle: float, reach: float, posts: int) -> tuple[int, int]:
    """The first post of an axis that is reached, and the one behind the last."""
    return max(0, math.floor(middle - reach)), min(posts, math.ceil(middle + reach) + 1)


def draw_errors(rng: np.random.Generator, setup: Setup) -> list[NDArray[np.float64]]:
    """An error of each variable: (1,) for all radials, and (n,) of the azimuth."""
    counts = [setup.radials if name == "azimuth_deg" else 1 for name in Variables._fields]
    return [
        sigma * rng.standard_normal(count) + step * rng.uniform(-0.5, 0.5, count)
        for sigma, step, count in zip(setup.sigma, setup.step, counts, strict=True)
    ]


def _thread(grid: Grid, setup: Setup, errors: list[NDArray[np.float64]]) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
    """States all round (n, M) with these errors, and which radials left the terrain."""
    state = [np.full(setup.radials, value) + error for value, error in zip(setup.true, errors, strict=True)]
    latitude, longitude, height, pitch, roll, heading, azimuth, tilt = state
    azimuth = np.radians(azimuth + np.arange(setup.radials) * (360 / setup.radials))
    direction = boresight(azimuth, np.radians(tilt), roll, pitch, heading)
    return predict(grid, Pointing(latitude, longitude, height, *direction), setup.bins, setup.bin_width_m, setup.beam)
