"""Which shadows count: those that are seen, or predicted, and left out all the same, and why.

Young, Uijt de Haag and Campbell (2004), section 4. A shadow that does not count pairs with nothing and is not called
unmatched; it may still be the partner that keeps a shadow of the other thread from being so.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor.prediction import Pointing
from monitor.settings import MonitorSettings
from monitor.terrain import Grid
from monitor.tracking import Fronts, front_points
from monitor.water import Water
from monitor.width import are_wide

Which = NDArray[np.bool_]


class Screens(NamedTuple):
    """What decides which bins and shadows count, beside the settings."""

    bins_left_out: NDArray[np.intp] | None = None  # at the beginning of each radial (n,)
    water: Water | None = None
    before: tuple[Fronts, ...] = ()  # of the scans before, as far as shadows are tracked


NO_SCREENS = Screens()


class Scene(NamedTuple):
    """The terrain and the radials in use (n,): scan angles, where the antenna was and looked, and how wide a bin is."""

    grid: Grid
    scan_angle_deg: NDArray[np.float64]
    pointing: Pointing
    bin_width_m: float


class Screened(NamedTuple):
    """Which shadows of the radar (k,) and of the terrain (m,) count, and how many do not and why."""

    radar: Which
    dem: Which
    reasons: list[str]


def screen(
    seen: NDArray[np.void], predicted: NDArray[np.void], scene: Scene, settings: MonitorSettings, screens: Screens
) -> Screened:
    """Judge the shadows of both threads. A reason counts all that it is true of, whatever else is."""
    radar, dem, reasons = np.ones(len(seen), bool), np.ones(len(predicted), bool), []
    for why, radar_counts, dem_counts in _judged(seen, predicted, scene, settings, screens):
        out = np.count_nonzero(~radar_counts), np.count_nonzero(~dem_counts)
        if any(out):
            reasons.append(f"{out[0]} radar and {out[1]} terrain shadows do not count: {why}")
        radar, dem = radar & radar_counts, dem & dem_counts
    return Screened(radar, dem, reasons)


def _judged(
    seen: NDArray[np.void], predicted: NDArray[np.void], scene: Scene, s: MonitorSettings, screens: Screens
) -> Iterator[tuple[str, Which, Which]]:
    threads = seen, predicted
    if minimum_deg := s.minimum_width_deg:
        angles, spacing_deg = scene.scan_angle_deg, s.radial_spacing_deg
        radar, dem = (are_wide(found, angles, spacing_deg, minimum_deg) for found in threads)
        yield f"narrower than {minimum_deg:g} degrees", radar, dem
    if water := screens.water:
        radar, dem = (~water.below(found, scene.pointing, scene.bin_width_m) for found in threads)
        yield f"over water of {s.minimum_water_km2:g} square kilometres or more", radar, dem
    if (scans := s.tracked_scans - 1) > 0:
        points_m = front_points(seen, scene.pointing, scene.grid, scene.bin_width_m)
        held = [fronts.hold(points_m, s.tracking_tolerance_m) for fronts in screens.before]
        enough = np.full(len(seen), len(held) == scans)
        why = f"no front there in each of {scans} scans before"
        if len(held) < scans:
            why += f", of which there are {len(held)}"
        yield why, np.logical_and.reduce([enough, *held]), np.ones(len(predicted), bool)
