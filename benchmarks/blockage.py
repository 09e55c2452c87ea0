"""How the ground fills the beam of the terrain thread, beside wradlib's beam blockage on one scan.

What the thread calls lit is ground that stands higher in the beam than all before it, so it is where the accumulated
blockage grows; before that the beam is clear, and where it does not grow, or is total, the ground is in shadow.
"""

from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray
from pyproj import Geod
from wradlib.georef import bin_altitude, bin_distance
from wradlib.qual import beam_block_frac, cum_beam_block_frac
from wradlib.util import half_power_radius

from monitor.geodesy import NM_M
from monitor.prediction import Beam, Pointing, predict
from monitor.shade import DEM_SHADOW
from monitor.terrain import open_terrain
from simulators.scenario import BUILT_IN_TERRAIN, white_mountains

RADIALS, BINS, RANGE_NM = 360, 512, 10.0
BEAM = Beam(azimuth_fan=1)
NEAR_BINS = 2  # from a border between what either calls clear, lit or shadow
CLEAR, LIT, SHADOW = range(3)
NAMES = ("clear", "lit", "shadow")
Kinds = NDArray[np.int64]


def section() -> list[str]:
    """The report's lines, as Markdown."""
    ours, theirs = scan()
    counts = [[int(np.sum((ours == mine) & (theirs == other))) for other in range(3)] for mine in range(3)]
    rows = [f"| {name} | " + " | ".join(map(str, row)) + " |" for name, row in zip(NAMES, counts, strict=True)]
    borders = _near_border(ours) | _near_border(theirs)
    return [
        f"Beside wradlib {version('wradlib')} (`beam_block_frac`, accumulated): one scan of the reference",
        f"configuration, {RADIALS} radials all round x {BINS} bins, beam {BEAM.width_deg:g} degrees. A bin of",
        "wradlib's is clear while the accumulated blockage is 0, lit where it grows, and in shadow where it does not",
        "or is total.",
        "",
        "| bins, ours down | " + " | ".join(f"wradlib: {name}" for name in NAMES) + " |",
        "|---|---|---|---|",
        *rows,
        "",
        f"{np.mean(ours == theirs):.1%} of all bins agree, and {np.mean((ours == theirs)[~borders]):.2%} of the",
        f"{np.mean(~borders):.0%} that are more than {NEAR_BINS} bins from any change. The rest differ because wradlib",
        "takes the ground of a bin where the beam's axis is at that range and the thread where the ground itself is,",
        "and because wradlib's beam edges are arcs added to the height of its axis on a sphere and the thread's are",
        "tangents on the ellipsoid.",
    ]


def scan() -> tuple[Kinds, Kinds]:
    """What the thread and wradlib call each bin of the same scan, (radials, bins)."""
    terrain = open_terrain(BUILT_IN_TERRAIN["white_mountains"])
    radar, flight = white_mountains().radar, white_mountains().flight
    azimuth_deg, ones = np.arange(RADIALS) * 360.0 / RADIALS, np.ones(RADIALS)
    here = flight.latitude_deg * ones, flight.longitude_deg * ones, flight.height_m * ones
    pointing = Pointing(*here, np.radians(azimuth_deg), np.radians(radar.tilt_deg) * ones)
    states, void = predict(terrain.grid, pointing, BINS, RANGE_NM * NM_M / BINS, BEAM)
    assert not void.any()
    ours = np.select([states > 0, states == DEM_SHADOW], [LIT, SHADOW], CLEAR)

    range_m = (np.arange(BINS) + 0.5) * RANGE_NM * NM_M / BINS
    axis_m = bin_altitude(range_m, radar.tilt_deg, flight.height_m)
    along_m = np.broadcast_to(bin_distance(range_m, radar.tilt_deg, flight.height_m), states.shape)
    start_lon, start_lat = np.full(states.shape, flight.longitude_deg), np.full(states.shape, flight.latitude_deg)
    azimuths_deg = np.broadcast_to(azimuth_deg[:, None], states.shape)
    lon, lat, _ = Geod(ellps="WGS84").fwd(start_lon, start_lat, azimuths_deg, along_m)
    with np.errstate(invalid="ignore"):  # of a root where the beam is clear or blocked, which it then writes over
        share = beam_block_frac(terrain.elevation(lat, lon), axis_m, half_power_radius(range_m, BEAM.width_deg))
    total = cum_beam_block_frac(share)
    before = np.pad(total, ((0, 0), (1, 0)))[:, :-1]
    theirs = np.select([total == 0, (total > before) & (share < 1)], [CLEAR, LIT], SHADOW)
    return ours, theirs


def _near_border(kinds: Kinds) -> NDArray[np.bool_]:
    """Bins with another kind on their radial at most `NEAR_BINS` away."""
    near = np.zeros(kinds.shape, bool)
    for apart in range(1, NEAR_BINS + 1):
        other = kinds[:, apart:] != kinds[:, :-apart]
        near[:, apart:] |= other
        near[:, :-apart] |= other
    return near
