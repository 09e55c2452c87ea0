"""Which shadows count: those that are seen, or predicted, and left out all the same, and why.

Young, Uijt de Haag and Campbell (2004), section 4. A shadow that does not count pairs with nothing and is not called
unmatched; it may still be the partner that keeps a shadow of the other thread from being so.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor.settings import MonitorSettings
from monitor.width import are_wide

Which = NDArray[np.bool_]


class Screens(NamedTuple):
    """What decides which bins and shadows count, beside the settings."""

    bins_left_out: NDArray[np.intp] | None = None  # at the beginning of each radial (n,)


NO_SCREENS = Screens()


class Screened(NamedTuple):
    """Which shadows of the radar (k,) and of the terrain (m,) count, and how many do not and why."""

    radar: Which
    dem: Which
    reasons: list[str]


def screen(
    seen: NDArray[np.void], predicted: NDArray[np.void], scan_angle_deg: NDArray[np.float64], settings: MonitorSettings
) -> Screened:
    """Judge the shadows of both threads on the radials in use (n,)."""
    radar, dem, reasons = np.ones(len(seen), bool), np.ones(len(predicted), bool), []
    for radar_counts, dem_counts, why in _rules(seen, predicted, scan_angle_deg, settings):
        out = np.count_nonzero(~radar_counts), np.count_nonzero(~dem_counts)
        if any(out):
            reasons.append(f"{out[0]} radar and {out[1]} terrain shadows do not count: {why}")
        radar, dem = radar & radar_counts, dem & dem_counts
    return Screened(radar, dem, reasons)


def _rules(
    seen: NDArray[np.void], predicted: NDArray[np.void], scan_angle_deg: NDArray[np.float64], s: MonitorSettings
) -> Iterator[tuple[Which, Which, str]]:
    if s.minimum_width_deg:
        radar, dem = (
            are_wide(found, scan_angle_deg, s.radial_spacing_deg, s.minimum_width_deg) for found in (seen, predicted)
        )
        yield radar, dem, f"narrower than {s.minimum_width_deg:g} degrees"
