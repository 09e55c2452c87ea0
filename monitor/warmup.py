"""Load the compiled kernels before the first scan needs them."""

import numpy as np

from decoders.arinc708 import unpack
from decoders.formats import MODES_708, WORD_708_BYTES
from monitor.aircraft import Aircraft
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.quantities import RADIO_HEIGHT
from monitor.scans import ScanBuilder

SECOND_NS = 1_000_000_000


def warm_up(monitor: Monitor) -> None:
    """Judge a made-up scan over the middle of the terrain and forget the answer."""
    grid = monitor.terrain.grid
    aircraft = Aircraft()
    middle = {
        "latitude_deg": grid.north_deg - grid.height_m.shape[0] / 2 * grid.row_deg,
        "longitude_deg": grid.west_deg + grid.height_m.shape[1] / 2 * grid.column_deg,
        "height_m": float(np.nanmax(grid.height_m)),
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
    Monitor(monitor.terrain, settings, water=monitor.water).judge(scans[-1], aircraft)
