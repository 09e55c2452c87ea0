"""What to simulate, as data: terrain, flight, radar, instruments and faults, from Python or a TOML file."""

import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

BUILT_IN_TERRAIN = {"white_mountains": Path(__file__).parent / "data" / "terrain" / "N44W072.hgt"}


class Settings(BaseModel):
    """A misspelt key is an error, and a scenario does not change once made."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Leg(Settings):
    """A straight stretch after the first; the turn on to it belongs to its duration."""

    heading_deg: float
    duration_s: Positive
    climb_mps: float = 0.0


class Flight(Settings):
    """Start, first leg and further legs; heights above mean sea level, headings true, speed over the ground."""

    latitude_deg: float = Field(ge=-89, le=89)
    longitude_deg: float = Field(ge=-180, le=180)
    height_m: float
    heading_deg: float
    ground_speed_mps: Positive = 90.0
    climb_mps: float = 0.0
    drift_deg: float = 0.0
    duration_s: Positive = 120.0
    legs: tuple[Leg, ...] = ()
    turn_rate_deg_s: Positive = 3.0
    turbulence_deg: NotNegative = 0.3

    @property
    def total_s(self) -> float:
        """Seconds from the start to the end of the last leg."""
        return self.duration_s + sum(leg.duration_s for leg in self.legs)


class World(Settings):
    """The ground flown over: stored terrain plus what the file does not know (`post_noise_m`, standard deviation).

    `incomplete` lets the radar look beyond the file or into its voids, from where nothing returns.
    """

    terrain: str = "white_mountains"
    post_noise_m: NotNegative = 3.0
    spacing_m: Positive = 30.0
    incomplete: bool = False

    @property
    def path(self) -> Path:
        """The built-in cell of that name, or the file."""
        return BUILT_IN_TERRAIN.get(self.terrain, Path(self.terrain))


class Radar(Settings):
    """A stabilised weather radar in map mode.

    `snr_db` is the median of the lit bins in the reference configuration; `azimuth_span` is how many beam widths to
    each side of the boresight count (the wider, the more the beam's skirt lights the edges of shadows).
    """

    antenna: Literal["wxr2100", "rdr4b"] = "wxr2100"
    payload: Literal["arinc708", "wxr2100_6bit"] = "arinc708"
    step_deg: Positive | None = None
    range_nm: float = Field(default=10.0, ge=5, le=320, multiple_of=5)
    tilt_deg: float = Field(default=-2.0, ge=-16, le=15.75, multiple_of=0.25)
    beam_width_deg: Positive = 3.5
    azimuth_span: Positive = 1.0
    snr_db: float = 18.0
    looks: Positive = 12.0


class Errors(Settings):
    """Standard deviations of the instruments' errors; a bias is drawn once a flight."""

    gnss_position_deg: NotNegative = 20e-6
    gnss_altitude_m: NotNegative = 5.0
    gnss_noise_m: NotNegative = 0.5
    inertial_angle_deg: NotNegative = 0.01
    inertial_drift_mps: NotNegative = 0.4
    inertial_altitude_m: NotNegative = 10.0
    radio_altitude_m: NotNegative = 0.5
    antenna_deg: NotNegative = 0.01


class Window(Settings):
    """Something named that lasts from `start_s` to `stop_s` of the flight."""

    name: str
    start_s: float = 0.0
    stop_s: float = float("inf")

    def covers(self, time_ns: int) -> bool:
        """Whether it lasts at that time."""
        return self.start_s <= time_ns / 1e9 < self.stop_s

    @model_validator(mode="after")
    def _window_runs_forward(self) -> Self:
        if self.stop_s <= self.start_s:
            raise ValueError(f"fault {self.name} stops at {self.stop_s} s, before it starts: set stop_s after start_s")
        return self


class Fault(Window):
    """A fault of the instruments; metres belong to `gnss_offset`, degrees to `heading_offset`."""

    name: Literal[
        "gnss_no_computed_data",
        "gnss_acquisition",
        "gnss_offset",
        "gnss_satellite_failure",
        "heading_offset",
        "inertial_failure_warning",
        "radio_altitude_no_computed_data",
        "radar_silent",
        "scanner_stuck",
    ]
    north_m: float = 0.0
    east_m: float = 0.0
    up_m: float = 0.0
    heading_deg: float = 0.0


class LinkFault(Window):
    """A fault between the buses and the host.

    `chance` is the share of packets or, on a line, of units that are hit; `rate_hz` how often garbage comes; `channel`
    the only one concerned; `clock_s` where the device's clock goes on after a jump.
    """

    name: Literal[
        "babble",
        "bit_flips",
        "clock_jump",
        "cut",
        "doubled",
        "fifo_overflow",
        "garbage",
        "lost",
        "parity_errors",
        "stall",
        "stuck",
        "truncated",
        "unplug",
        "word_length_errors",
        "wrong_crc",
    ]
    chance: float = Field(default=1.0, gt=0, le=1)
    rate_hz: Positive = 100.0
    channel: int | None = Field(default=None, ge=0, le=255)
    clock_s: NotNegative = 0.0

    @model_validator(mode="after")
    def _takes_what_it_is_given(self) -> Self:
        strange = self.model_fields_set - {"name", "start_s", "stop_s"} - LINK_FAULT_SETTINGS.get(self.name, {"chance"})
        if strange:
            raise ValueError(f"link fault {self.name} takes no {', '.join(sorted(strange))}: leave it out")
        return self


LINK_FAULT_SETTINGS = {  # of those that do not take `chance` alone
    "babble": {"channel"},
    "clock_jump": {"clock_s"},
    "cut": set[str](),
    "fifo_overflow": {"chance", "channel"},
    "garbage": {"rate_hz"},
    "parity_errors": {"chance", "channel"},
    "stall": set[str](),
    "unplug": set[str](),
    "word_length_errors": {"chance", "channel"},
}


class Scenario(Settings):
    """Everything that decides the traffic, byte for byte."""

    flight: Flight
    world: World = World()
    radar: Radar = Radar()
    errors: Errors = Errors()
    faults: tuple[Fault, ...] = ()
    link_faults: tuple[LinkFault, ...] = ()
    epoch: AwareDatetime = datetime(2026, 6, 1, 12, 0, 0, tzinfo=UTC)
    gnss_interval_s: float = Field(default=1.0, ge=0.1, le=2.0)
    seed: int = Field(default=0, ge=0)


def white_mountains(duration_s: float = 120.0, seed: int = 0) -> Scenario:
    """The reference configuration: low over the White Mountains, 10 NM in 512 bins, two degrees down."""
    flight = Flight(
        latitude_deg=44.37514, longitude_deg=-71.71874, height_m=761.0, heading_deg=197.6, duration_s=duration_s
    )
    return Scenario(flight=flight, seed=seed)


def load(path: Path) -> Scenario:
    """The scenario of a TOML file; a relative terrain path counts from there. Raises ValueError naming file and key."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        scenario = Scenario.model_validate(document)
    except OSError as error:
        raise ValueError(f"scenario {path}: {error.strerror}: name another file") from None
    except (tomllib.TOMLDecodeError, ValidationError) as error:
        raise ValueError(f"scenario {path}: {error}") from None
    world = scenario.world
    if world.terrain in BUILT_IN_TERRAIN:
        return scenario
    beside = world.model_copy(update={"terrain": str(path.parent / world.terrain)})
    return scenario.model_copy(update={"world": beside})
