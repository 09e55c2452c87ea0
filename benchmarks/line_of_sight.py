"""The shadows of the terrain thread, its beam opened to plain line of sight, beside those of the viewshed programs."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, maximum_filter, minimum_filter

from benchmarks.viewsheds import TOOLS, Sight, Surroundings, surroundings
from monitor.geodesy import NM_M
from monitor.prediction import Beam, Pointing, predict
from monitor.terrain import open_terrain
from simulators.scenario import BUILT_IN_TERRAIN

RADIALS, BINS = 360, 512
BEAM = Beam(width_deg=178.0, azimuth_fan=1)  # from straight down to straight up, and the boresight alone
CELLS_A_POST = 2  # the programs' grid is finer than the stored posts by so much
STEP_M = 2.0  # along a radial, to find where the ground of a bin is
PLACES, SEED = 3, 20
ABOVE_GROUND_M = (150.0, 600.0)
LEAST = 0.997
WHITE_MOUNTAINS = BUILT_IN_TERRAIN["white_mountains"]
SIERRA_NEVADA = Path(__file__).parents[1] / "tests" / "data" / "terrain" / "sierra_nevada_1arcsec_wgs84.tif"
GROUND = {WHITE_MOUNTAINS: (10.0, 90.0), SIERRA_NEVADA: (5.0, 30.0)}  # range in NM, posts in metres


class Seen(NamedTuple):
    """Which bins the thread lights, (radials, bins), and the programs' cell of each; -1 where there is no ground."""

    lit: NDArray[np.bool_]
    row: NDArray[np.intp]
    column: NDArray[np.intp]


class Agreement(NamedTuple):
    """Of so many bins off the edges how many agree, and of all."""

    off_edges: int
    off_edges_agree: int
    bins: int
    bins_agree: int


def section() -> list[str]:
    """The report's lines, as Markdown."""
    versions = ", ".join(f"{name} ({found()})" for name, (found, _) in TOOLS.items())
    heights = " and ".join(f"{height:g}" for height in ABOVE_GROUND_M)
    lines = [
        f"Beside {versions}: a beam of {BEAM.width_deg:g} degrees at tilt 0 sees whatever is",
        f"in line of sight, with the same refraction (k = {BEAM.refraction_k:.3f}). The programs work on the terrain",
        f"warped to {CELLS_A_POST} cells a post, in metres about the observer. {RADIALS} radials x {BINS} bins at",
        f"{PLACES} drawn places a terrain, at {heights} m above ground. A bin is",
        "off the edges where the program sees all cells within a post of the bin's ground, or none of them; edges of",
        "the thread's own excuse nothing.",
        "",
        "| terrain | program | bins off the edges | agree there | worst place and height | of all bins agree |",
        "|---|---|---|---|---|---|",
    ]
    for terrain in GROUND:
        places = list(_places(terrain))
        for name, (_, sight) in TOOLS.items():
            each = [_compare(*place, sight) for place in places]
            total = Agreement(*np.sum(each, axis=0).tolist())
            share = total.off_edges_agree / total.off_edges
            worst = min(one.off_edges_agree / one.off_edges for one in each)
            lines.append(
                f"| {terrain.name} | {name} | {total.off_edges} of {total.bins} | {share:.5f} ({_word(share)}) "
                f"| {worst:.5f} | {total.bins_agree / total.bins:.4f} |"
            )
    return [*lines, "", f"The claim is {LEAST:g} off the edges for each terrain and program."]


def _word(share: float) -> str:
    return "holds" if share >= LEAST else "FAILS"


def _places(terrain: Path) -> Iterator[tuple[Surroundings, float, Seen]]:
    """Each drawn place at each height, from where the range stays within the file."""
    grid = open_terrain(terrain).grid
    rows, columns = grid.height_m.shape
    range_nm, post_m = GROUND[terrain]
    margin_deg = (range_nm + 0.5) / 60
    random = np.random.default_rng(SEED)
    for _ in range(PLACES):
        lat = grid.north_deg - random.uniform(margin_deg, (rows - 1) * grid.row_deg - margin_deg)
        aside_deg = margin_deg / math.cos(math.radians(lat))
        lon = grid.west_deg + random.uniform(aside_deg, (columns - 1) * grid.column_deg - aside_deg)
        about = surroundings(terrain, lat, lon, range_nm * NM_M, post_m / CELLS_A_POST)
        for above_m in ABOVE_GROUND_M:
            yield about, above_m, _thread(terrain, about, above_m, range_nm * NM_M)


def _thread(path: Path, about: Surroundings, above_m: float, reach_m: float) -> Seen:
    """What the terrain thread lights; and where, found by the slant range alone and without its help."""
    height_m, ones, azimuth = about.ground_m + above_m, np.ones(RADIALS), np.radians(np.arange(RADIALS))
    here = about.latitude_deg * ones, about.longitude_deg * ones, height_m * ones
    states, void = predict(open_terrain(path).grid, Pointing(*here, azimuth, 0 * ones), BINS, reach_m / BINS, BEAM)
    along_m = np.arange(0, reach_m, STEP_M)
    range_m = (np.arange(BINS) + 0.5) * reach_m / BINS
    row, column = np.full((2, RADIALS, BINS), -1)
    for k in np.flatnonzero(~void):
        east, north = math.sin(azimuth[k]) / about.cell_m, math.cos(azimuth[k]) / about.cell_m
        cells = about.middle - north * along_m, about.middle + east * along_m
        depth_m = height_m - map_coordinates(about.height_m, cells, order=1)
        chord_m = along_m * (1 + (height_m - depth_m / 2) / about.earth_radius_m)
        s = np.interp(range_m, np.maximum.accumulate(np.hypot(chord_m, depth_m)), along_m)
        ground = states[k] >= 0
        row[k, ground] = np.rint(about.middle - north * s)[ground]
        column[k, ground] = np.rint(about.middle + east * s)[ground]
    return Seen(states > 0, row, column)


def _compare(about: Surroundings, above_m: float, ours: Seen, sight: Sight) -> Agreement:
    theirs = sight(about, above_m, BEAM.refraction_k)
    size = 2 * CELLS_A_POST + 1
    uniform = minimum_filter(theirs, size) == maximum_filter(theirs, size)
    ground = ours.row >= 0
    cells = ours.row[ground], ours.column[ground]
    agree, off = theirs[cells] == ours.lit[ground], uniform[cells]
    return Agreement(int(off.sum()), int((agree & off).sum()), len(agree), int(agree.sum()))
