"""The search for the horizontal error that explains an alert, where there is none to find."""

import numpy as np

from decoders.formats import MODES_708
from monitor.calibration import uncalibrated
from monitor.offset import Search
from monitor.prediction import Pointing
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from tests.monitor.ground import LATITUDE, LONGITUDE, mesa, plain

RADIALS, BINS, BIN_M = 3, 64, 100.0


def scan(dark: slice) -> Scan:
    """Three radials to the north that are lit but for some bins."""
    bins = np.full((RADIALS, BINS), 3, np.uint8)
    bins[:, dark] = 0
    return Scan(
        number=0,
        time_ns=np.zeros(RADIALS, np.int64),
        scan_angle_deg=np.array([0.0, 3.0, 6.0]),
        beyond_limits=np.zeros(RADIALS, bool),
        bins=bins,
        tilt_deg=0.0,
        range_nm=BINS * BIN_M / 1852,
        mode=MODES_708["map"],
        stabilised=True,
        faults=0,
        missing=0,
        repeated=0,
    )


def search(terrain: Terrain, seen: Scan) -> Search:
    one = np.ones(RADIALS)
    pointing = Pointing(LATITUDE * one, LONGITUDE * one, 400.0 * one, 0 * one, 0 * one)
    settings = MonitorSettings(beam_width_deg=20, azimuth_fan=1, offset_search_m=400)
    return Search(seen, np.arange(RADIALS), pointing, terrain, settings, uncalibrated(BINS))


def test_where_no_shadows_pair_anywhere_no_error_is_named() -> None:
    assert search(Terrain(plain(), (), ""), scan(slice(40, 50))).most_likely() is None


def test_an_error_along_ridges_is_not_made_up_and_none_is_beyond_the_search() -> None:
    """The shadow of a table mountain from west to east tells nothing of an error to the east: the least is named."""
    found = search(Terrain(mesa(2000.0, 2500.0, 250.0), (), ""), scan(slice(30, 45))).most_likely()
    assert found is not None
    assert found.east_m == 0
    assert abs(found.north_m) <= 400
