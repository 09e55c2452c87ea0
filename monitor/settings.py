"""What the monitor can be told: every option with its unit, its bounds and a sentence."""

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

SEARCH_STEP_M = 200.0  # shadows of mountains move together over about as far
MOST_GIVEN = 0.95 + 1e-9  # of p_fa, to other tests than the statistic; with room for rounding
SHAPING = (
    "beam_width_deg",
    "azimuth_fan",
    "azimuth_span",
    "refraction_k",
    "range_reference",
    "radial_spacing_deg",
    "minimum_size",
    "maximum_size",
    "minimum_width_deg",
    "pairing",
    "range_limit_nm",
    "first_bin_from_radio_altitude",
    "tracked_scans",
)
HeightSource = Literal["076", "370"]


class LeverArm(BaseModel):
    """From the GNSS antenna to the radar antenna in the aircraft's body, metres."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    forward_m: float = Field(0.0, ge=-100, le=100)
    right_m: float = Field(0.0, ge=-100, le=100)
    down_m: float = Field(0.0, ge=-100, le=100)


class MonitorSettings(BaseModel):
    """The integrity monitor's options; the defaults are the ones the evidence is given for."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    method: Literal["robust", "paper"] = Field("robust", description="which test decides: clipped Q, or T as published")
    p_fa: float = Field(1e-4, ge=1e-12, lt=0.5, description="probability of a false alert in one scan")
    shift_budget: float = Field(0.6, ge=0, le=0.95, description="share of p_fa that goes to the test for a shift")
    unmatched_dem_budget: float = Field(
        0.35, ge=0, le=0.95, description="share of p_fa that goes to the test of unmatched terrain shadows"
    )
    unmatched_radar_budget: float = Field(
        0.0, ge=0, le=0.95, description="the same of radar shadows, which a weak signal makes too"
    )
    window_scans: int = Field(
        1, ge=1, le=30, description="scans whose pairs may be gathered where one has too few for a verdict"
    )
    alert_scans: int = Field(1, ge=1, le=30, description="scans in a row beyond a threshold that make an alert")
    clear_scans: int = Field(1, ge=1, le=30, description="scans in a row within the thresholds that end an alert")
    offset_search_m: float = Field(
        1200.0,
        ge=0,
        le=5000,
        description="how far to each side a horizontal error is sought that explains an alert, 200 at least; 0: never",
    )
    p_md: float = Field(
        1e-3, gt=0, lt=1, description="probability of a missed detection that the stated MDB stands for"
    )
    minimum_pairs: int | None = Field(
        None,
        ge=2,
        le=65_536,
        description="pairs below which Q and T are unavailable; 16 if not set, 20 for p_fa of 1e-4 and below",
    )
    beam_width_deg: float = Field(3.5, gt=0.1, le=30, description="one-way 3 dB width of the antenna beam")
    azimuth_fan: int = Field(7, ge=1, le=99, description="sub-azimuths across the beam; 1 is the paper's form")
    azimuth_span: float = Field(0.75, gt=0, le=2, description="how far the fan reaches each side, beam widths")
    refraction_k: float = Field(
        4 / 3, ge=0.5, description="effective Earth radius factor; inf for the paper's flat Earth"
    )
    range_reference: Literal["centre", "far_edge"] = Field("centre", description="where in its bin a range is taken")
    radial_spacing_deg: float = Field(
        3.0, ge=0.01, le=30, description="one radial in every so many degrees is compared"
    )
    minimum_size: int = Field(3, ge=1, le=65_536, description="smallest shadow used, range bins")
    maximum_size: int | None = Field(None, ge=1, le=65_536, description="largest shadow used, range bins")
    unmatched_size: int = Field(
        8, ge=1, le=65_536, description="smallest shadow whose lack of a partner is counted, range bins"
    )
    minimum_width_deg: float = Field(
        0.0, ge=0, le=180, description="a shadow counts if overlapping ones of neighbouring radials reach so far across"
    )
    pairing: Literal["overlap", "first"] = Field(
        "overlap", description="shadows pair by overlap, or first against first: the paper's calibration"
    )
    range_limit_nm: float | None = Field(
        None, gt=0, le=320, description="ignore everything beyond; the range setting if not set"
    )
    radio_altitude_limit_m: float | None = Field(
        None, gt=0, le=20_000, description="height over ground (label 164) above which nothing is compared; no limit"
    )
    first_bin_from_radio_altitude: bool = Field(
        False, description="leave out the bins that lie nearer than the beam's lower edge meets flat ground"
    )
    minimum_water_km2: float = Field(
        1.0, ge=0, le=1e9, description="the rack's water counts as water from this size on, square kilometres"
    )
    tracked_scans: int = Field(
        1, ge=1, le=20, description="a radar shadow counts if so many scans in a row have its front; 1 tracks nothing"
    )
    # Three bins of 10 NM / 512, beyond which an edge is another one; half the way between radials half a degree apart,
    # 81 m at 10 NM, lies within. It must stay below what the aircraft flies in a sweep: 180 m at 90 m/s and 2 s.
    tracking_tolerance_m: float = Field(
        110.0, gt=0, le=10_000, description="within which a front is at the same place on the ground in the next scan"
    )
    lever_arm: LeverArm = LeverArm()
    height_source: HeightSource = Field(
        "076", description="label of the GNSS height: 076 above mean sea level, or 370 above the ellipsoid, with EGM96"
    )
    position_gate: bool = Field(
        True, description="demand that the GNSS receiver vouches for its position with labels 273 and 130"
    )
    largest_integrity_limit_nm: float = Field(
        0.3, gt=0, le=15, description="horizontal integrity limit (130) up to which a position is precise enough, NM"
    )
    control_delay_s: float = Field(1.0, ge=0, le=60, description="what the radar may take to do what its panel asks")

    @model_validator(mode="after")
    def _some_shadow_has_a_size(self) -> Self:
        if self.maximum_size is not None and self.maximum_size < self.minimum_size:
            raise ValueError(f"maximum_size {self.maximum_size} is below minimum_size {self.minimum_size}")
        if self.maximum_size is not None and self.maximum_size < self.unmatched_size:
            raise ValueError(f"maximum_size {self.maximum_size} is below unmatched_size {self.unmatched_size}")
        return self

    @model_validator(mode="after")
    def _something_is_left_for_the_statistic(self) -> Self:
        if (given := self.shift_budget + self.unmatched_dem_budget + self.unmatched_radar_budget) > MOST_GIVEN:
            raise ValueError(f"shift_budget and the unmatched budgets are {given:g} together: leave Q 0.05 of p_fa")
        return self

    @model_validator(mode="after")
    def _a_search_has_more_than_one_place(self) -> Self:
        if 0 < self.offset_search_m < SEARCH_STEP_M:
            raise ValueError(f"offset_search_m {self.offset_search_m:g} is below {SEARCH_STEP_M:g}: 0 searches nothing")
        return self

    @property
    def shaping(self) -> dict[str, str]:
        """The options on which disparities and shadows depend, in words: a calibration holds for these alone."""
        return {name: str(getattr(self, name)) for name in SHAPING}

    @property
    def uses_radio_altitude(self) -> bool:
        """Whether a radial needs the radio altimeter."""
        return self.radio_altitude_limit_m is not None or self.first_bin_from_radio_altitude

    @property
    def pairs_needed(self) -> int:
        """The least number of pairs for a verdict; where Q could not reach its threshold, more are needed."""
        return self.minimum_pairs or (20 if self.p_fa <= 1e-4 else 16)
