"""Load the compiled kernels before the first scan needs them."""

import numpy as np

from decoders.arinc708 import unpack
from decoders.formats import MODES_708, WORD_708_BYTES
from monitor.aircraft import Aircraft
from monitor.ceiling import ceilings
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.quantities import RADIO_HEIGHT
from monitor.scans import ScanBuilder
from monitor.terrain import Extent, Grid, Terrain

SECOND_NS = 1_000_000_000
SPACING_DEG, HALF = 0.001, 300  # posts to each side: the made-up scan reaches 10 NM


def warm_up(monitor: Monitor) -> None:
    """Judge a made-up scan over made-up ground and forget the answer: the stored one may be void, or not at hand."""
    ground = _ridges(monitor.terrain.extent)
    aircraft = Aircraft()
    middle = {
        "latitude_deg": (ground.extent.south + ground.extent.north) / 2,
        "longitude_deg": (ground.extent.west + ground.extent.east) / 2,
        "height_m": 1500.0,
    }
    times = np.array([0, SECOND_NS // 10])
    for quantity in (*NEEDED, RADIO_HEIGHT):
        values = np.full(2, middle.get(quantity.name, 0.0))
        aircraft.tracks[quantity.name].append(times, values, np.zeros(2, np.uint8))
    angles = np.tile(np.arange(-9.0, 10.0, 3.0), 4)  # the ends of the third sweep are compared with the second's
    n = len(angles)
    radials = unpack(np.zeros((n, WORD_708_BYTES), np.uint8))._replace(
        scan_angle_deg=angles,
        bins=np.tile(np.arange(512, dtype=np.uint8) // 8 % 2, (n, 1)),
        mode=np.full(n, MODES_708["map"], np.uint8),
        tilt_deg=np.full(n, -2.0),
        range_nm=np.full(n, 10.0),
    )
    builder = ScanBuilder()
    scans = [*builder.feed(np.full(n, SECOND_NS // 20), radials), *builder.finish()]
    settings = monitor.settings.model_copy(update={"minimum_pairs": 2, "position_gate": False})
    Monitor(ground, settings, water=monitor.water).judge(scans[-1], aircraft)


def _ridges(extent: Extent) -> Terrain:
    """Ridges across the way north, 2 km apart, around the middle of an area."""
    latitude_deg, longitude_deg = (extent.south + extent.north) / 2, (extent.west + extent.east) / 2
    rows_m = 500 + 500 * np.sin(np.arange(HALF * 2) * (2 * np.pi / 20))
    height_m = np.repeat(rows_m.astype(np.float32)[:, None], HALF * 2, axis=1)
    corner = latitude_deg + HALF * SPACING_DEG, longitude_deg - HALF * SPACING_DEG
    return Terrain(Grid(height_m, *corner, SPACING_DEG, SPACING_DEG, ceilings(height_m)), (), "")
