"""The search for the horizontal error that explains an alert: with shadows that do not count, and with none to find."""

from dataclasses import replace
from math import atan2, degrees, hypot
from pathlib import Path

import numpy as np
import pytest
from pyproj import Geod

from decoders.formats import MODES_708
from monitor.calibration import uncalibrated
from monitor.integrity import Monitor
from monitor.offset import Search
from monitor.prediction import Pointing
from monitor.quantities import RADIO_HEIGHT
from monitor.scans import Scan
from monitor.screening import NO_SCREENS, Screens
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from monitor.water import Water, open_water
from tests.monitor.ground import LATITUDE, LONGITUDE, mesa, plain
from tests.monitor.scanning import ANGLES, CALIBRATED, HERE, MS, flying, honest_scan
from tests.monitor.test_water import square, written

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


def search(terrain: Terrain, seen: Scan, screens: Screens = NO_SCREENS) -> Search:
    one = np.ones(RADIALS)
    pointing = Pointing(LATITUDE * one, LONGITUDE * one, 400.0 * one, 0 * one, 0 * one)
    settings = MonitorSettings(beam_width_deg=20, azimuth_fan=1, offset_search_m=400)
    return Search(seen, np.arange(RADIALS), pointing, terrain, settings, uncalibrated(BINS, seen.range_nm, ""), screens)


def test_where_no_shadows_pair_anywhere_no_error_is_named() -> None:
    assert search(Terrain(plain(), (), ""), scan(slice(40, 50))).most_likely() is None


def test_an_error_along_ridges_is_not_made_up_and_none_is_beyond_the_search() -> None:
    """The shadow of a table mountain from west to east tells nothing of an error to the east: the least is named."""
    found = search(Terrain(mesa(2000.0, 2500.0, 250.0), (), ""), scan(slice(30, 45))).most_likely()
    assert found is not None
    assert found.east_m == 0
    assert abs(found.north_m) <= 400


def test_where_all_that_pairs_is_screened_out_no_error_is_named() -> None:
    """The shadow of the table mountain again, which is under water."""
    terrain, seen = Terrain(mesa(2000.0, 2500.0, 250.0), (), ""), scan(slice(30, 45))
    flooded = Screens(water=Water(terrain.grid, np.ones(terrain.grid.height_m.shape, bool)))
    assert search(terrain, seen).most_likely() is not None
    assert search(terrain, seen, flooded).most_likely() is None


ONE, OTHER = (400.0, -200.0), (-200.0, 400.0)  # metres north and east
HEIGHT_M, NEAR = 700.0, 295  # a lower edge 3.75 degrees down meets flat ground at 10.7 km: so many whole bins of 36 m
WEST, EAST = (-72.1, HERE["longitude_deg"]), (HERE["longitude_deg"], -70.9)  # of the aircraft, in degrees


def from_off(terrain: Terrain, north_m: float, east_m: float) -> Scan:
    """What the radar sees if it is not where the state says, but so far from there."""
    azimuth_deg, distance_m = degrees(atan2(east_m, north_m)), hypot(north_m, east_m)
    there = Geod(ellps="WGS84").fwd(HERE["longitude_deg"], HERE["latitude_deg"], azimuth_deg, distance_m)
    return honest_scan(terrain, longitude_deg=there[0], latitude_deg=there[1])


def found(terrain: Terrain, seen: Scan, lake: Path | None = None, height_m: float | None = None) -> object:
    """The error that an alert names."""
    settings = MonitorSettings(
        p_fa=0.1, minimum_pairs=5, offset_search_m=600, first_bin_from_radio_altitude=height_m is not None
    )
    aircraft = flying()
    if height_m is not None:
        times, values = np.array([0, 200 * MS]), np.full(2, height_m)
        aircraft.tracks[RADIO_HEIGHT.name].append(times, values, np.zeros(2, np.uint8))
    calibration = CALIBRATED.model_copy(update={"sigma_bins": 1.5})
    water = open_water(lake, terrain, 1.0) if lake else None
    verdict, _ = Monitor(terrain, settings, calibration, water).judge(seen, aircraft)
    assert verdict.verdict == "alert"
    return verdict.offset_north_m, verdict.offset_east_m


def lake_in(path: Path, longitudes: tuple[float, float]) -> Path:
    return written(path, square(longitudes[0], 43.9, longitudes[1], 45.1))


def test_water_and_a_first_bin_from_radio_altitude_leave_the_error_that_is_found(
    white_mountains: Terrain, tmp_path: Path
) -> None:
    seen = from_off(white_mountains, *ONE)
    for lake in (None, lake_in(tmp_path / "west.json", WEST), lake_in(tmp_path / "east.json", EAST)):
        for height_m in (None, HEIGHT_M):
            assert found(white_mountains, seen, lake, height_m) == ONE


@pytest.mark.parametrize(("dry", "error"), [(EAST, OTHER), (WEST, ONE)], ids=["in the east", "in the west"])
def test_shadows_over_water_have_no_say_in_the_error_that_is_found(
    white_mountains: Terrain, tmp_path: Path, dry: tuple[float, float], error: tuple[float, float]
) -> None:
    """In the west the radar sees what speaks for one error, in the east what speaks for the other."""
    western = HERE["heading_deg"] + ANGLES > 180
    one, other = from_off(white_mountains, *ONE), from_off(white_mountains, *OTHER)
    seen = replace(one, bins=np.where(western[:, None], one.bins, other.bins))
    wet = EAST if dry == WEST else WEST
    assert found(white_mountains, seen, lake_in(tmp_path / "lake.json", wet)) == error


def test_bins_before_the_first_have_no_say_in_the_error_that_is_found(white_mountains: Terrain) -> None:
    """Near ground, of which most is seen, speaks for one error, and far ground for the other."""
    one, other = from_off(white_mountains, *ONE), from_off(white_mountains, *OTHER)
    seen = replace(one, bins=np.where(np.arange(512) < NEAR, one.bins, other.bins))
    assert found(white_mountains, seen) == ONE
    assert found(white_mountains, seen, height_m=HEIGHT_M) == OTHER
