"""Many short flights: legs drawn over a terrain file."""

from collections.abc import Iterator

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.warp import transform_bounds

from simulators import antenna, dem
from simulators.flight import Trajectory
from simulators.measurements import METRES_PER_DEGREE
from simulators.radar import METRES_PER_NM
from simulators.scenario import Radar, Scenario
from simulators.traffic import REACH_MARGIN_M

Floats = NDArray[np.float64]

STEP_DEG = 3.0  # about a beam width, so that neighbouring radials are nearly independent
CLEARANCE_M = (250.0, 500.0)


def draw_legs(
    base: Scenario, count: int, seed: int, scans: int = 2, clearance_m: tuple[float, float] = CLEARANCE_M
) -> Iterator[Scenario]:
    """`count` short flights over the base scenario's terrain: `scans` scans at 3 degrees, each with its own seed.

    Heading and place are uniform, the place over the part of the file from which the radar sees only the file or, where
    the world is incomplete, over the middle half of the file. The height is `clearance_m`, uniform between the two,
    above the highest ground under the leg. Raises ValueError when the file is too small for that.
    """
    rng = np.random.default_rng((seed, count))
    radar = base.radar.model_copy(update={"step_deg": STEP_DEG})
    duration = scans * scan_duration_s(radar)
    west, south, east, north = _safe_bounds(base, duration)
    for number in range(count):
        flight = base.flight.model_copy(
            update={
                "latitude_deg": rng.uniform(south, north),
                "longitude_deg": rng.uniform(west, east),
                "heading_deg": rng.uniform(0.0, 360.0),
                "duration_s": duration,
                "legs": (),
            }
        )
        track = Trajectory(flight, seed).at(np.linspace(0.0, duration, 20))
        quiet = base.world.model_copy(update={"post_noise_m": 0.0})
        ground = dem.sample(quiet, track.latitude_deg[:, None], track.longitude_deg[:, None], seed)
        height = float(np.nanmax(ground, initial=0.0)) + rng.uniform(*clearance_m)
        flight = flight.model_copy(update={"height_m": height})
        yield base.model_copy(update={"flight": flight, "radar": radar, "seed": base.seed + number})


def scan_duration_s(radar: Radar) -> float:
    """Seconds that one pass over the sector takes, every radial included."""
    timetable = antenna.scan(radar)
    return timetable.positions * timetable.interval_s


def _safe_bounds(base: Scenario, duration_s: float) -> tuple[float, float, float, float]:
    """West, south, east and north limits in degrees for the start of a leg."""
    with rasterio.open(base.world.path) as file:
        west, south, east, north = transform_bounds(file.crs, "EPSG:4326", *file.bounds)
    if base.world.incomplete:
        wide, high = (east - west) / 4, (north - south) / 4
        return west + wide, south + high, east - wide, north - high
    reach = base.radar.range_nm * METRES_PER_NM + REACH_MARGIN_M + base.flight.ground_speed_mps * duration_s
    high = 1.01 * reach / METRES_PER_DEGREE
    wide = high / np.cos(np.radians(max(abs(south), abs(north))))
    if west + wide >= east - wide or south + high >= north - high:
        raise ValueError(
            f"{base.world.path.name} is too small to look {base.radar.range_nm} NM all round: "
            "shorten the range or set world.incomplete = true"
        )
    return west + wide, south + high, east - wide, north - high
