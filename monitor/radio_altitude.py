"""What the height over ground by the radio altimeter (label 164) allows: comparing at all, and from which bin on.

Young, Uijt de Haag and Campbell (2004), section 4 (c).
"""

import math

import numpy as np
from numpy.typing import NDArray


def too_high(height_m: NDArray[np.float64], limit_m: float) -> str | None:
    """Why nothing is compared, if the aircraft was above the limit on any of the radials (n,)."""
    above = height_m > limit_m
    if not above.any():
        return None
    return (
        f"radio altitude up to {height_m.max():.0f} m, the monitor works to {limit_m:g} m: "
        f"above on {np.count_nonzero(above)} of {len(height_m)} radials"
    )


def first_bins(
    height_m: NDArray[np.float64], elevation_rad: NDArray[np.float64], beam_width_deg: float, bin_width_m: float
) -> tuple[NDArray[np.intp], list[str]]:
    """How many bins at the beginning of each radial (n,) lie wholly nearer than flat ground in the beam, eq. (14).

    R = |h_AGL / tan(gamma - theta_B / 2)| with the beam's elevation gamma. A lower edge that is level or looks up never
    meets flat ground: there no bin is left out, and the list says so.
    """
    edge = elevation_rad - math.radians(beam_width_deg) / 2
    down = edge < 0
    slope = np.abs(np.tan(np.where(down, edge, -math.pi / 4)))
    bins = np.where(down, np.minimum(np.abs(height_m) / slope / bin_width_m, np.iinfo(np.int32).max), 0)
    never = np.count_nonzero(~down)
    if not never:
        return bins.astype(np.intp), []
    return bins.astype(np.intp), [
        f"the beam's lower edge never meets flat ground on {never} of {len(down)} radials: no bin is left out there"
    ]
