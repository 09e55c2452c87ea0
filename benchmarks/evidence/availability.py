"""In which share of the scans the monitor can answer at all."""

from collections.abc import Sequence

from benchmarks.evidence.faults import NONE
from benchmarks.evidence.flown import Flown
from benchmarks.evidence.tables import share, table
from monitor.calibration import Calibration
from monitor.decision import examine
from monitor.settings import MonitorSettings

HEIGHTS_M = ((0, 300), (300, 500), (500, 700), (700, 1000), (1000, 2000))
ROUGHNESS_M = ((0, 100), (100, 200), (200, 300), (300, 600))
SETTINGS = MonitorSettings(p_fa=1e-4)


def page(flown: Sequence[Flown], calibrations: dict[str, Calibration]) -> str:
    """By height above the ground below and by the standard deviation of the ground within 10 km."""
    rows = []
    for low, high in HEIGHTS_M:
        cells = []
        for smooth, rough in ROUGHNESS_M:
            scans = [
                examine(scan, SETTINGS, calibrations[flight.kind.terrain]).statistic is not None
                for flight in flown
                if low <= flight.height_above_ground_m < high and smooth <= flight.roughness_m < rough
                for scan in flight.samples[NONE.name]
            ]
            cells.append(share(sum(scans), len(scans)))
        rows.append([f"{low} to {high} m above ground", *cells])
    return table(["", *(f"ground {smooth} to {rough} m" for smooth, rough in ROUGHNESS_M)], rows)
