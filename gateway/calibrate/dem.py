"""The Monte Carlo of the terrain thread on all cores: a table in the form of the paper's Table 5, and its file."""

import json
import math
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from itertools import islice, repeat
from typing import Any, Final, NamedTuple

from decoders.definitions import load_definitions
from gateway.calibrate.page import Histogram
from gateway.calibrate.radar import text
from gateway.calibrate.workers import on_all_cores
from gateway.errors import GatewayError
from monitor.bus_steps import bus_steps
from monitor.geodesy import NM_M
from monitor.monte_carlo import NO_STEPS, TABLE_4, Outcome, Setup, Variables, around, simulate
from monitor.prediction import Beam
from monitor.residuals import (
    NORMALITY_TEST,
    correlation,
    moments,
    normality,
    sigma_of_independent_edges,
)
from monitor.settings import MonitorSettings
from monitor.terrain import Grid, Terrain

RUNS_AT_ONCE = 25
ABOVE_GROUND_M = (250.0, 450.0, 650.0, 850.0, 1050.0)  # of the paper's altitudes over its place, an airport at 1346 m
PAPER_BIN_M, PAPER_BINS, PAPER_SIZES = 144.8, 128, (3, 126)  # of 256 bins those up to the paper's limit of 10 NMI
EDGES = ("front", "back", "centre", "size")
HEADINGS: Final = {
    "height (m MSL)": ("height_m", ".0f"),
    "radials off the terrain": ("radials_that_left_the_terrain", "d"),
    "radials with a shadow": ("radials_with_a_shadow", "d"),
    "N": ("pairs", "d"),
    **{f"mean {edge}": (f"mean_{edge}_bins", ".2f") for edge in EDGES},
    **{f"sigma {edge}": (f"sigma_{edge}_bins", ".2f") for edge in EDGES},
    "correlation": ("front_back_correlation", ".2f"),
    "sigma centre by (11)": ("sigma_centre_by_eq_11_bins", ".2f"),
    "p if normal": ("p_if_normal", ".2g"),
}
EXPLANATION = f"""Residuals of shadow edges, centres and sizes under the errors, against the same terrain and state
without them, in range bins; N is the number of pairs of shadows. Equation (11) takes front and back edges to be
independent: the correlation says whether they are. The last column is the p value of {NORMALITY_TEST}, of the centres:
small where the residuals are not normal."""


class Row(NamedTuple):
    """A height above mean sea level and what its runs gave."""

    height_m: float
    outcome: Outcome


class Place(NamedTuple):
    """Where the aircraft is, and the height of the ground below it."""

    latitude_deg: float
    longitude_deg: float
    ground_m: float


def place_of(terrain: Terrain, at: str | None) -> Place:
    """The place that "LAT,LON" names, or the middle of the terrain. Raises GatewayError if there is no ground."""
    south, north, west, east = terrain.extent
    middle = [(south + north) / 2, (west + east) / 2]
    latitude, longitude = _numbers(at, 2, "--at takes LAT,LON in degrees, as 44.5,-71.5") if at else middle
    longitude = float(terrain.extent.framed(longitude))
    ground = float(terrain.elevation(latitude, longitude))
    if math.isnan(ground):
        raise GatewayError(f"the terrain has no height at {latitude:.6f}, {longitude:.6f}: name a place in it by --at")
    return Place(latitude, longitude, ground)


def heights_of(written: str | None, place: Place) -> list[float]:
    """The heights that "1600,1800" names, or the paper's over the ground. Raises GatewayError for one in the ground."""
    if written is None:
        return [round(place.ground_m) + above for above in ABOVE_GROUND_M]
    heights = _numbers(written, None, "--heights-m takes metres above mean sea level, as 1600,1800")
    if min(heights) <= place.ground_m:
        raise GatewayError(f"{min(heights):g} m is not above the ground, which lies at {place.ground_m:.0f} m there")
    return heights


def _numbers(written: str, count: int | None, mend: str) -> list[float]:
    try:
        numbers = [float(part) for part in written.split(",")]
    except ValueError as error:
        raise GatewayError(f"{written!r}: {mend}") from error
    if len(numbers) != (count or len(numbers)) or not all(map(math.isfinite, numbers)):
        raise GatewayError(f"{written!r}: {mend}")
    return numbers


def setup_of(true: Variables, s: MonitorSettings, bins: int, range_nm: float, post_noise_m: float, seed: int) -> Setup:
    """As the monitor works: its beam and shadows, and the steps in which a bus tells the state."""
    return Setup(
        true,
        TABLE_4,
        bus_steps(load_definitions("gnss_743a"), load_definitions("iru_704")),
        post_noise_m,
        bins,
        range_nm * NM_M / bins,
        Beam.of(s),
        (s.minimum_size, s.maximum_size or bins),
        "overlap",
        seed,
    )


def as_published(setup: Setup) -> Setup:
    """The paper's form: boresight alone, flat Earth, far edges of bins, its radar, first shadows, no steps of a bus."""
    return setup._replace(
        step=NO_STEPS,
        bins=PAPER_BINS,
        bin_width_m=PAPER_BIN_M,
        beam=Beam(setup.beam.width_deg, azimuth_fan=1, refraction_k=math.inf, range_reference="far_edge"),
        sizes=PAPER_SIZES,
        pairing="first",
    )


def monte_carlo(grid: Grid, setup: Setup, heights_m: Sequence[float], runs: int) -> Iterator[Row]:
    """A row for each height. Raises GatewayError if no radial stays within the terrain."""
    near = around(grid, setup)
    parts = [range(at, min(at + RUNS_AT_ONCE, runs)) for at in range(0, runs, RUNS_AT_ONCE)]
    setups = [setup._replace(true=setup.true._replace(height_m=height)) for height in heights_m for _ in parts]
    outcomes = on_all_cores(simulate, repeat(near), setups, parts * len(heights_m))
    for height in heights_m:
        outcome = Outcome.joined(list(islice(outcomes, len(parts))))
        if outcome.lost == runs * setup.radials:
            reach_nm = setup.bins * setup.bin_width_m / NM_M
            raise GatewayError(
                f"every radial of {reach_nm:.0f} NM leaves the terrain: name more files or another place"
            )
        yield Row(height, outcome)


def figures(row: Row) -> dict[str, Any]:
    """What a height gave, as the file says it; None where there is too little."""
    r = row.outcome.residuals
    found = {edge: moments(getattr(r, edge)) for edge in EDGES}
    return {
        "height_m": row.height_m,
        "radials_with_a_shadow": row.outcome.shadowed,
        "radials_that_left_the_terrain": row.outcome.lost,
        "pairs": len(r.front),
        **{f"mean_{edge}_bins": found[edge].mean for edge in EDGES},
        **{f"sigma_{edge}_bins": found[edge].sigma for edge in EDGES},
        "front_back_correlation": correlation(r),
        "sigma_centre_by_eq_11_bins": sigma_of_independent_edges(r),
        "p_if_normal": normality(r.centre),
    }


def table(rows: Sequence[Row]) -> list[list[str]]:
    """The figures as `HEADINGS` says."""
    return [[text(said[name], form) for name, form in HEADINGS.values()] for said in map(figures, rows)]


def histograms(rows: Sequence[Row]) -> list[Histogram]:
    """The residuals of centres at each height."""
    return [Histogram(f"{row.height_m:.0f} m", row.outcome.residuals.centre) for row in rows]


def provenance(terrain: Terrain, setup: Setup, runs: int) -> str:
    """All that the figures depend on."""
    return (
        f"{runs} runs of {setup.radials} radials, seed {setup.seed}, at {setup.true.latitude_deg:.6f}, "
        f"{setup.true.longitude_deg:.6f}, tilt {setup.true.tilt_deg:g} degrees, over "
        f"{', '.join(path.name for path in terrain.paths)} (checksum {terrain.checksum}); {setup.bins} bins of "
        f"{setup.bin_width_m:.2f} m, shadows of {setup.sizes[0]} to {setup.sizes[1]} bins paired by {setup.pairing}; "
        f"beam {_listed(setup.beam)}; sigma of errors {_listed(setup.sigma)}, of posts {setup.post_noise_m:g} m; "
        f"steps {_listed(setup.step)}; "
        f"shadebus {version('shadebus')}"
    )


def _listed(named: Beam | Variables) -> str:
    return ", ".join(f"{name} {value}" for name, value in named._asdict().items())


def file_text(name: str, said: str, rows: Sequence[Row]) -> str:
    """The JSON file."""
    return json.dumps({"name": name, "provenance": said, "heights": [figures(row) for row in rows]}, indent=2) + "\n"
