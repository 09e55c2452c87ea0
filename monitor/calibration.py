"""How disparities are distributed when nothing is wrong, measured for one radar and one class of terrain.

The robust fit follows from the heavy tails of real terrain: the median m, a robust spread r (normalised median absolute
deviation), the clip at +-k r, the root mean square sigma of what the clip leaves, and the variance factor
c = E[(Q - N)^2] / E[2 N], which is 1 for independent normal disparities and grows with errors common to a scan.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from scipy.special import ndtri

from monitor.disparity import clipped, robust_statistic, robust_threshold

QUARTILE = float(ndtri(0.75))  # of a normal distribution: half of it lies nearer to its median
CLIP_FACTOR = 2.0


class CheckedRate(BaseModel):
    """What a configured P_FA came to on scans that the fit had not seen."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    p_fa: float
    scans: int
    alerts: int


class Calibration(BaseModel):
    """The file that the monitor loads; bins are range bins of the radar it was measured with."""

    # A NaN or an infinite sigma would make Q pass every threshold.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    name: str
    provenance: str
    bins: int | None = None
    range_nm: float | None = None
    median_bins: float
    spread_bins: float = Field(gt=0)
    sigma_bins: float = Field(gt=0)
    rms_bins: float = Field(gt=0)
    variance_factor: float = Field(ge=1)
    checked: tuple[CheckedRate, ...] = ()

    @property
    def clip_bins(self) -> float:
        """The largest deviation from the median that counts in full."""
        return CLIP_FACTOR * self.spread_bins

    def mismatch(self, bins: int, range_nm: float) -> str | None:
        """Why the calibration does not hold for a scan, or None."""
        if self.bins not in (None, bins):
            return f"calibration {self.name} is for {self.bins} range bins, the radar sends {bins}"
        if self.range_nm not in (None, range_nm):
            return (
                f"calibration {self.name} is for a range of {self.range_nm:g} NM, the radar is set to {range_nm:g} NM"
            )
        return None


NO_CALIBRATION = "none"

_DEFAULTS = Calibration(
    name=NO_CALIBRATION,
    provenance="stated defaults: spread and sigma of a beam-averaged radar over mountains, not measured for this radar",
    bins=512,
    median_bins=0.0,
    spread_bins=2.2,
    sigma_bins=2.6,
    rms_bins=7.0,
    variance_factor=1.5,
)


@cache
def uncalibrated(bins: int) -> Calibration:
    """Stated defaults for a radar of so many bins that nobody has calibrated.

    The errors behind a disparity are angles, so they are a share of the range setting: coarser bins count fewer.
    """
    scale = bins / 512
    scaled = {name: getattr(_DEFAULTS, name) * scale for name in ("spread_bins", "sigma_bins", "rms_bins")}
    return _DEFAULTS.model_copy(update={"bins": bins, **scaled})


def load_calibration(path: Path) -> Calibration:
    """Read a calibration file. Raises ValueError naming the file and what is wrong in it."""
    try:
        return Calibration.model_validate_json(path.read_bytes())
    except OSError as error:
        raise ValueError(f"calibration file {path} cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        raise ValueError(f"calibration file {path}: {place}: {first['msg']}") from error


def fit(
    scans: Sequence[NDArray[np.float64]],
    check: Sequence[NDArray[np.float64]],
    p_fas: Sequence[float],
    minimum_pairs: int,
    *,
    name: str,
    provenance: str,
    bins: int | None = None,
    range_nm: float | None = None,
) -> Calibration:
    """Fit to the disparities of fault-free scans, and count on other scans how often each P_FA would have alerted.

    Each scan is an array of disparities in bins; those with fewer than `minimum_pairs` are left out, as in flight.
    """
    usable = [d for d in scans if len(d) >= minimum_pairs]
    if len(usable) < 2:
        raise ValueError(
            f"only {len(usable)} scans have {minimum_pairs} pairs: fly longer, lower or over rougher terrain"
        )
    pooled = np.concatenate(usable)
    median = float(np.median(pooled))
    spread = float(np.median(np.abs(pooled - median)) / QUARTILE)
    if not spread:
        raise ValueError("half of the disparities are equal, so they have no spread: fit to a radar with its noise")
    sigma = float(np.sqrt(np.mean(clipped(pooled, median, CLIP_FACTOR * spread) ** 2)))
    q = np.array([robust_statistic(d, median, CLIP_FACTOR * spread, sigma) for d in usable])
    n = np.array([len(d) for d in usable])
    factor = max(1.0, float(np.mean((q - n) ** 2) / np.mean(2 * n)))
    held_out = [d for d in check if len(d) >= minimum_pairs]
    rates = [
        CheckedRate(
            p_fa=p,
            scans=len(held_out),
            alerts=sum(
                robust_statistic(d, median, CLIP_FACTOR * spread, sigma) > robust_threshold(len(d), p, factor)
                for d in held_out
            ),
        )
        for p in p_fas
    ]
    return Calibration(
        name=name,
        provenance=provenance,
        bins=bins,
        range_nm=range_nm,
        median_bins=median,
        spread_bins=spread,
        sigma_bins=sigma,
        rms_bins=float(np.sqrt(np.mean(pooled**2))),
        variance_factor=factor,
        checked=tuple(rates),
    )
