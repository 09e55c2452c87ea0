"""What scans are like when nothing is wrong, measured for one radar and one class of terrain: the file of it."""

from functools import cache
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

CLIP_FACTOR = 2.0


class CheckedRate(BaseModel):
    """What a configured P_FA came to, with all tests, on scans that the fit had not seen."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    p_fa: float
    scans: int
    alerts: int


class UnmatchedModel(BaseModel):
    """How large a share of one thread's eligible shadows has no partner when nothing is wrong.

    Of shadows of `least_size` range bins and more. `overdispersion` is rho of the variance m (1 - m) (1 / n + rho): 0
    for shadows that stand or fall each by itself.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    mean: float = Field(gt=0, lt=1)
    overdispersion: float = Field(ge=0, le=1)
    least_size: int = Field(3, ge=1)  # of the files that do not say


class CommonErrors(BaseModel):
    """Errors that the disparities of a scan have in common: of the position, and of the height.

    `place_bins` is the standard deviation of a shift, north and east each, in range bins; `stretch` that of how much a
    disparity grows with each bin of the shadow's size, since shadows seen from higher up are shorter.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    place_bins: float = Field(ge=0)
    stretch: float = Field(ge=0)


class LevelLimits(BaseModel):
    """Between which signal levels the fault-free scans lay."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    lowest: float
    highest: float


class Calibration(BaseModel):
    """The file that the monitor loads; bins are range bins of the radar it was measured with."""

    # A NaN or an infinite sigma would make Q pass every threshold.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    name: str
    provenance: str
    bins: int | None = None
    range_nm: float | None = None
    radar_profile: str | None = None
    median_bins: float
    spread_bins: float = Field(gt=0)
    sigma_bins: float = Field(gt=0)
    rms_bins: float = Field(gt=0)
    variance_factor: float = Field(ge=1)
    common: CommonErrors | None = None
    unmatched_radar: UnmatchedModel | None = None
    unmatched_dem: UnmatchedModel | None = None
    level: LevelLimits | None = None
    checked: tuple[CheckedRate, ...] = ()

    @property
    def clip_bins(self) -> float:
        """The largest deviation from the median that counts in full."""
        return CLIP_FACTOR * self.spread_bins

    def mismatch(self, bins: int, range_nm: float, profile: str) -> str | None:
        """Why the calibration does not hold for a scan, or None. Of a profile "" nothing is known."""
        if self.bins not in (None, bins):
            return f"calibration {self.name} is for {self.bins} range bins, the radar sends {bins}: {MEND}"
        if self.range_nm not in (None, range_nm):
            return (
                f"calibration {self.name} is for a range of {self.range_nm:g} NM, the radar is set to {range_nm:g} NM: "
                f"{MEND}"
            )
        if profile and self.radar_profile not in (None, profile):
            return f"calibration {self.name} is for radar profile {self.radar_profile}, this one is {profile}: {MEND}"
        return None


NO_CALIBRATION = "none"
MEND = "load one that was made for it, or none"

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
        mend = "if another version made it, make it anew with shadebus calibrate radar"
        raise ValueError(f"calibration file {path}: {place}: {first['msg']}; {mend}") from error
