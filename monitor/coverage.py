"""Why the stored terrain says nothing where the aircraft is: it flies outside the files, or over a gap in them."""

import numpy as np
from numpy.typing import NDArray

from monitor.prediction import Pointing
from monitor.terrain import Extent


def uncovered(height_over_ground_m: NDArray[np.float64], extent: Extent, pointing: Pointing) -> list[str]:
    """Reasons with their mend, for radials (n,) that start where the height over ground (n,) is not known."""
    lat, lon = pointing.latitude_deg, pointing.longitude_deg
    unknown = np.isnan(height_over_ground_m)
    south, north, west, east = extent
    framed = extent.framed(lon)
    outside = unknown & ((lat < south) | (lat > north) | (framed < west) | (framed > east))
    reasons = []
    if outside.any():
        k = int(np.argmax(outside))
        reasons.append(
            f"the aircraft, at {lat[k]:.3f} {lon[k]:.3f}, is outside the stored terrain, latitudes {south:.3f} to "
            f"{north:.3f} and longitudes {west:.3f} to {east:.3f}: name the files of where it flies"
        )
    if (unknown & ~outside).any():
        k = int(np.argmax(unknown & ~outside))
        reasons.append(
            f"the stored terrain has a gap below the aircraft, at {lat[k]:.3f} {lon[k]:.3f}: name a file that fills it"
        )
    return reasons
