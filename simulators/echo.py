"""The mean ground echo of one radial, by ray casting: what a pencil of rays under a Gaussian beam brings back.

For ground of constant gamma (sigma0 = gamma sin psi at grazing angle psi) the area that a strip of visible elevation
d_eps and azimuth d_az lights is A = R^2 d_eps d_az / sin psi, so that its echo G^2 sigma0 A / R^4 becomes
gamma G^2 d_eps d_az / R^2: the slope drops out, and what counts is how much of the view the ground fills.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from simulators.terrain import Ground, Heights

Floats = NDArray[np.float64]

EARTH_RADIUS_M = 6_371_000.0
REFRACTION = 4.0 / 3.0
SAMPLE_M = 15.0
SUB_AZIMUTHS = 9
TWO_WAY = 8 * math.log(2)  # a Gaussian power gain out and back is exp(-TWO_WAY x^2), x in one-way half-power widths


@dataclass(frozen=True)
class Views:
    """Where n radials look from and to, arrays (n,): metres on the ground's raster, bearings from its north."""

    east: Floats
    north: Floats
    height_m: Floats
    bearing_deg: Floats


@dataclass(frozen=True)
class Beam:
    """A stabilised Gaussian beam: boresight elevation over local level, and the one-way half-power width.

    In elevation the whole pattern counts, in azimuth `azimuth_span` widths to each side: at 1 the gain out and back is
    24 dB down and a real main lobe ends, at 0.6 it is cut at two standard deviations.
    """

    tilt_deg: float
    width_deg: float
    azimuth_span: float = 1.0


def mean_echo(ground: Ground, views: Views, beam: Beam, range_m: float, bins: int) -> Floats:
    """Echo power (n, bins) of n radials per gamma, in 1/m^2, before noise and speckle, out to a slant range.

    Unknown ground neither returns nor hides anything.
    """
    widths_off = np.linspace(-beam.azimuth_span, beam.azimuth_span, SUB_AZIMUTHS)
    offsets = np.radians(widths_off * beam.width_deg)
    weights = two_way_gain(widths_off) * (offsets[1] - offsets[0])
    raster = (ground.heights, ground.west, ground.south, ground.spacing)
    places = np.column_stack([views.east, views.north, views.height_m])
    power = np.zeros((len(places), bins))
    for row, (east, north, height), bearing in zip(power, places, views.bearing_deg, strict=True):
        for offset, weight in zip(offsets, weights, strict=True):
            pencil = (math.radians(beam.tilt_deg), math.radians(beam.width_deg), weight)
            _cast_ray(raster, (east, north, height, math.radians(bearing) + offset), pencil, range_m / bins, row)
    return power


def two_way_gain(beam_widths_off: Floats) -> Floats:
    """Power gain out and back, 1 on boresight, at angles off it in units of the one-way half-power width."""
    return np.exp(-TWO_WAY * beam_widths_off**2)


@njit(cache=True)
def _height(raster: tuple[Heights, float, float, float], east: float, north: float) -> float:
    """Bilinear height, NaN off the raster."""
    heights, west, south, spacing = raster
    column, row = (east - west) / spacing, (north - south) / spacing
    if not (0 <= column < heights.shape[1] - 1 and 0 <= row < heights.shape[0] - 1):
        return math.nan
    j, i = int(column), int(row)
    x, y = column - j, row - i
    lower = heights[i, j] * (1 - x) + heights[i, j + 1] * x
    upper = heights[i + 1, j] * (1 - x) + heights[i + 1, j + 1] * x
    return float(lower * (1 - y) + upper * y)


@njit(cache=True)
def _gain_below(angle: float, tilt: float, width: float) -> float:
    """Two-way gain integrated over all elevations below an angle, in radians; only differences matter."""
    return math.erf(math.sqrt(TWO_WAY) * (angle - tilt) / width) * width * math.sqrt(math.pi / TWO_WAY) / 2


@njit(cache=True)
def _cast_ray(
    raster: tuple[Heights, float, float, float],
    place: tuple[float, float, float, float],
    pencil: tuple[float, float, float],
    bin_m: float,
    power: Floats,
) -> None:
    """Add one sub-azimuth's echo to `power` (bins,): walk outwards and let each stretch of ground give what shows.

    Ground shows as far as its elevation angle rises above the highest one so far, and the beam is integrated over
    that rise. Tangents order as angles do and are cheaper, so angles are taken only where ground shows.
    """
    east, north, own_height, bearing = place
    tilt, width, weight = pencil
    sine, cosine = math.sin(bearing), math.cos(bearing)
    skyline = last_tangent = -math.inf
    skyline_gain = last_slant = math.nan
    for sample in range(1, int(len(power) * bin_m / SAMPLE_M) + 2):
        along = sample * SAMPLE_M
        height = _height(raster, east + along * sine, north + along * cosine)
        across = along * (1 + height / EARTH_RADIUS_M)
        below = height - along * along / (2 * REFRACTION * EARTH_RADIUS_M) - own_height
        tangent, slant = below / across, math.sqrt(across * across + below * below)
        if tangent > skyline:
            gain = _gain_below(math.atan(tangent), tilt, width)
            if not math.isnan(last_slant):
                hidden = (skyline - last_tangent) / (tangent - last_tangent)
                echo = weight * (gain - skyline_gain) / (slant * slant)
                _spread(echo, (last_slant + hidden * (slant - last_slant)) / bin_m, slant / bin_m, power)
            skyline, skyline_gain = tangent, gain
        last_tangent, last_slant = tangent, slant


@njit(cache=True)
def _spread(echo: float, start: float, stop: float, power: Floats) -> None:
    """Share an echo over the bins between two ranges counted in bins, so that none starves between samples."""
    near, far = min(start, stop), max(start, stop)
    for k in range(int(near), min(int(far), len(power) - 1) + 1):
        share = 1.0 if far == near else (min(far, k + 1.0) - max(near, float(k))) / (far - near)
        power[k] += echo * share
