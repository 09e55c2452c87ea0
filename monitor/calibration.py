"""What scans are like when nothing is wrong, measured for one radar and one class of terrain: the file of it."""

from functools import cache
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from monitor.settings import MonitorSettings

CLIP_FACTOR = 2.0
NO_CALIBRATION = "none"
LEAST_BINS = 0.001  # of a spread: edges are whole bins, so no radar is as exact
MOST_BINS = 256  # half of the usual radar's: nothing that pairs is farther apart when nothing is wrong


class _Section(BaseModel):
    # A NaN or an infinite sigma would make Q pass every threshold; a number in quotes is a slip of the hand.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class CheckedRate(_Section):
    """What a configured P_FA came to, with all tests, on scans that the fit had not seen."""

    p_fa: float = Field(gt=0, lt=1)
    scans: int = Field(ge=0)
    alerts: int = Field(ge=0)


class UnmatchedModel(_Section):
    """How large a share of one thread's eligible shadows has no partner when nothing is wrong.

    Of shadows of `least_size` range bins and more. `overdispersion` is rho of the variance m (1 - m) (1 / n + rho): 0
    for shadows that stand or fall each by itself.
    """

    mean: float = Field(gt=0, lt=1)
    overdispersion: float = Field(ge=0, le=1)
    least_size: int = Field(3, ge=1)  # of the files that do not say


class EdgeModel(_Section):
    """How far edges of the radar's shadows lie from the terrain's when nothing is wrong, range bins.

    Their median, and the largest deviation from it that counts in full.
    """

    median_bins: float = Field(ge=-MOST_BINS, le=MOST_BINS)
    clip_bins: float = Field(ge=LEAST_BINS, le=MOST_BINS)


class ShiftModel(_Section):
    """How disparities lie over the azimuths when nothing is wrong.

    Both edges, the scatter `sigma_bins` of the disparities of clipped edges, and two errors that the pairs of a scan
    have in common: of the position, and of the height. `place_bins` is the standard deviation of a shift, north and
    east each, in range bins; `stretch` that of how much a disparity grows with each bin of the shadow's size, since
    shadows seen from higher up are shorter.
    """

    front: EdgeModel
    back: EdgeModel
    sigma_bins: float = Field(ge=LEAST_BINS, le=MOST_BINS)
    place_bins: float = Field(ge=0, le=MOST_BINS)
    stretch: float = Field(ge=0, le=10)

    @model_validator(mode="after")
    def _some_pair_stands_out(self) -> Self:
        if self.sigma_bins > (clip := (self.front.clip_bins + self.back.clip_bins) / 2):
            raise ValueError(f"sigma_bins {self.sigma_bins:g} is above {clip:g}, where disparities are clipped")
        return self


class Limits(_Section):
    """Between which values the fault-free scans lay, of their signal levels or of their heights."""

    lowest: float
    highest: float

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.lowest > self.highest:
            raise ValueError(f"lowest {self.lowest:g} is above highest {self.highest:g}")
        return self

    def hold(self, value: float) -> bool:
        """Whether a value lies between them; one that is no number does not."""
        return self.lowest <= value <= self.highest


class Calibration(_Section):
    """The file that the monitor loads, and the radar it was measured with; bins are range bins.

    `height_m` are limits of the antenna's mean height above the ground below it; `options` the monitor's options that
    shape disparities, as `MonitorSettings.shaping` gives them, none in files that do not say.
    """

    name: str = Field(min_length=1, pattern=r"^\P{C}+$")  # it stands in the line of every verdict
    provenance: str
    bins: int = Field(ge=1)
    range_nm: float = Field(gt=0)
    radar_profile: str
    median_bins: float = Field(ge=-MOST_BINS, le=MOST_BINS)
    spread_bins: float = Field(ge=LEAST_BINS, le=MOST_BINS)
    sigma_bins: float = Field(ge=LEAST_BINS, le=MOST_BINS)
    rms_bins: float = Field(ge=LEAST_BINS, le=MOST_BINS)
    variance_factor: float = Field(ge=1, le=1000)
    shift: ShiftModel | None = None
    unmatched_radar: UnmatchedModel | None = None
    unmatched_dem: UnmatchedModel | None = None
    level: Limits | None = None
    height_m: Limits | None = None
    options: dict[str, str] = {}
    checked: tuple[CheckedRate, ...] = Field((), strict=False)  # which JSON has as a list

    @model_validator(mode="before")
    @classmethod
    def _of_older_versions(cls, given: object) -> object:
        """Their `common` errors are of disparities whose edges were not clipped: without a `shift` S is not tested."""
        if not isinstance(given, dict):
            return given
        return {name: value for name, value in given.items() if name != "common"}

    @model_validator(mode="after")
    def _some_disparity_stands_out(self) -> Self:
        if self.sigma_bins > self.clip_bins:  # of what is clipped
            raise ValueError(
                f"sigma_bins {self.sigma_bins:g} is above {CLIP_FACTOR:g} spread_bins, where it is clipped"
            )
        return self

    @property
    def clip_bins(self) -> float:
        """The largest deviation from the median that counts in full."""
        return CLIP_FACTOR * self.spread_bins

    def mismatch(self, bins: int, range_nm: float, profile: str, settings: MonitorSettings) -> str | None:
        """Why the calibration does not hold for a scan and a monitor, or None. Of a profile "" nothing is known."""
        if self.bins != bins:
            return f"calibration {self.name} is for {self.bins} range bins, the radar sends {bins}: {MEND}"
        if self.range_nm != range_nm:
            return (
                f"calibration {self.name} is for a range of {self.range_nm:g} NM, the radar is set to {range_nm:g} NM: "
                f"{MEND}"
            )
        if profile and self.radar_profile != profile:
            return f"calibration {self.name} is for radar profile {self.radar_profile}, this one is {profile}: {MEND}"
        for name, ours in settings.shaping.items():
            theirs = self.options.get(name, ours)
            if theirs != ours:
                return f"calibration {self.name} was made with {name} {theirs}, the monitor has {ours}: {MEND}"
        return None


MEND = "load one that was made for it, or none"


@cache
def uncalibrated(bins: int, range_nm: float, radar_profile: str) -> Calibration:
    """Stated defaults for a radar that nobody has calibrated: of a beam-averaged one over mountains.

    The errors behind a disparity are angles, so they are a share of the range setting: coarser bins count fewer.
    """
    scale = bins / 512
    return Calibration(
        name=NO_CALIBRATION,
        provenance="stated defaults, not measured for this radar",
        bins=bins,
        range_nm=range_nm,
        radar_profile=radar_profile,
        median_bins=0.0,
        spread_bins=2.2 * scale,
        sigma_bins=2.6 * scale,
        rms_bins=7.0 * scale,
        variance_factor=1.5,
    )


def load_calibration(path: Path) -> Calibration:
    """Read a calibration file. Raises ValueError naming the file and what is wrong in it."""
    try:
        found = Calibration.model_validate_json(path.read_bytes())
    except OSError as error:
        raise ValueError(f"calibration file {path} cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        mend = "mend it, or make it anew with shadebus calibrate radar"
        raise ValueError(f"calibration file {path}: {place}: {first['msg']}; {mend}") from error
    if found.name == NO_CALIBRATION:
        raise ValueError(f"calibration file {path}: its name is {NO_CALIBRATION!r}, as if there were none: rename it")
    return found
