"""A scan over the White Mountains, the aircraft that made it, and a calibration: to judge, changed or as they are.

The echoes are the monitor's own prediction, moved by a known number of range bins: they serve tests of the decision,
and the prediction has tests of its own.
"""

from dataclasses import replace
from math import radians

import numpy as np
from numpy.typing import NDArray

from decoders.formats import MODES_708
from monitor.aircraft import Aircraft
from monitor.calibration import Calibration
from monitor.comparison import Comparison
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.prediction import Beam, Pointing, predict
from monitor.quantities import GNSS_MODE, INTEGRITY_LIMIT, SATELLITE_FAILURE
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from monitor.verdict import Verdict

MS = 1_000_000
NO_COMPUTED_DATA = 1  # the status
ANGLES = np.arange(-90.0, 91.0, 3.0)
HERE = {"latitude_deg": 44.37514, "longitude_deg": -71.71874, "height_m": 761.0, "heading_deg": 197.6}
TILT_DEG = -2.0
CALIBRATED = Calibration(
    name="test radar",
    provenance="made up",
    bins=512,
    range_nm=10.0,
    radar_profile="arinc708",
    median_bins=0.0,
    spread_bins=2.0,
    sigma_bins=2.5,
    rms_bins=5.0,
    variance_factor=1.25,
)
NAVIGATION = 0b01100
VOUCHED = {"gnss_mode": NAVIGATION, "horizontal_integrity_limit_m": 185.2, "gnss_satellite_failure": 0.0}


def flying(**changed: float) -> Aircraft:
    """Level flight over the White Mountains, with a sample of everything 100 ms before and after the scan."""
    aircraft = Aircraft()
    for quantity in (*NEEDED, GNSS_MODE, INTEGRITY_LIMIT, SATELLITE_FAILURE):
        value = {**HERE, **VOUCHED, **changed}.get(quantity.name, 0.0)
        aircraft.tracks[quantity.name].append(np.array([0, 200 * MS]), np.full(2, value), np.zeros(2, np.uint8))
    return aircraft


def lit(
    terrain: Terrain, azimuth: NDArray[np.float64], elevation: NDArray[np.float64], **changed: float
) -> NDArray[np.int8]:
    place = {**HERE, **changed}
    latitude, longitude, height = (
        np.full(len(azimuth), place[name]) for name in ("latitude_deg", "longitude_deg", "height_m")
    )
    pointing = Pointing(latitude, longitude, height, azimuth, elevation)
    states, void = predict(terrain.grid, pointing, 512, 18_520 / 512, Beam())
    assert not void.any()
    return states


def scan_of(echoes: NDArray[np.uint8], angles: NDArray[np.float64] = ANGLES) -> Scan:
    n = len(angles)
    return Scan(
        number=7,
        time_ns=np.full(n, 100 * MS),
        scan_angle_deg=angles,
        beyond_limits=np.zeros(n, bool),
        bins=echoes,
        tilt_deg=TILT_DEG,
        range_nm=10.0,
        mode=MODES_708["map"],
        stabilised=True,
        faults=0,
        missing=0,
        repeated=0,
    )


def honest_scan(terrain: Terrain, **changed: float) -> Scan:
    """One that agrees with the terrain to the bin; from another place than `HERE` if that is changed."""
    azimuth, elevation = np.radians(HERE["heading_deg"] + ANGLES), np.full(len(ANGLES), radians(TILT_DEG))
    states = lit(terrain, azimuth, elevation, **changed)
    return scan_of(3 * (states > 0).astype(np.uint8))


def moved(scan: Scan, bins: int) -> Scan:
    """Every echo so many bins farther out; the first bins go dark."""
    echoes = np.roll(scan.bins, bins, axis=1)
    echoes[:, slice(bins) if bins > 0 else slice(bins, None)] = 0
    return replace(scan, bins=echoes)


def judge(
    terrain: Terrain,
    scan: Scan,
    aircraft: Aircraft | None = None,
    calibration: Calibration | None = CALIBRATED,
    settings: MonitorSettings | None = None,
) -> tuple[Verdict, Comparison]:
    verdict, comparison = Monitor(terrain, settings, calibration).judge(scan, aircraft or flying())
    assert comparison is not None
    return verdict, comparison
