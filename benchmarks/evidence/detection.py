"""How often each fault is found, how soon, and by which test."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from benchmarks.evidence.false_alerts import found, unmatched
from benchmarks.evidence.faults import FAULTS, NONE, SCAN_S
from benchmarks.evidence.flown import TERRAINS, Flown
from benchmarks.evidence.tables import share, table
from monitor.calibration import Calibration
from monitor.decision import examine, shift_test
from monitor.disparity import minimum_detectable_bias
from monitor.sample import ScanSample
from monitor.settings import MonitorSettings

P_FA = 1e-4
ENOUGH_PAIRS = 20
WITHIN = 2  # scans
BIN_M = 10 * 1852 / 512
PAIRS = ((20, 30), (30, 45), (45, 62))
SHIFTS_M = (50, 100, 200, 500)
WAYS = ("T as published", "Q", "shift", "unmatched", "mean", "default")


def _by_test(scan: ScanSample, calibration: Calibration) -> dict[str, bool]:
    """What each test alone, at the whole P_FA, and the default say."""
    paper = examine(scan, MonitorSettings(p_fa=P_FA, method="paper"), calibration)
    alone = examine(scan, MonitorSettings(p_fa=P_FA, shift_budget=0.0, unmatched_dem_budget=0.0), calibration)
    enough = len(scan.disparities) >= ENOUGH_PAIRS
    verdicts = (
        bool(paper.alerts),
        found(alone.statistic),
        enough and found(shift_test(scan, calibration, P_FA)),
        found(unmatched(scan, calibration, P_FA)),
        _mean(scan, calibration),
        bool(examine(scan, MonitorSettings(p_fa=P_FA), calibration).alerts),
    )
    return dict(zip(WAYS, verdicts, strict=True))


def _mean(scan: ScanSample, calibration: Calibration) -> bool:
    """The mean against its own standard error, two-sided."""
    d = scan.disparities
    if len(d) < ENOUGH_PAIRS:
        return False
    error = float(np.std(d, ddof=1)) / math.sqrt(len(d))
    return abs(float(np.mean(d)) - calibration.median_bins) > float(ndtri(1 - P_FA / 2)) * error


def by_fault(flown: Sequence[Flown], calibrations: dict[str, Calibration]) -> str:
    """A row for each fault: the share of flights found within two scans by each test, and when the default finds it."""
    enough = [
        flight
        for flight in flown
        if max(len(scan.disparities) for scan in flight.samples[NONE.name][:WITHIN]) >= ENOUGH_PAIRS
    ]
    rows = []
    for fault in FAULTS:
        said = [
            [_by_test(scan, calibrations[flight.kind.terrain]) for scan in flight.samples[fault.name]]
            for flight in enough
        ]
        shares = [_found(said, way) for way in WAYS]
        over = [
            _found(
                [scans for scans, flight in zip(said, enough, strict=True) if flight.kind.terrain == name], "default"
            )
            for name in TERRAINS
        ]
        first = [next((k for k, scan in enumerate(scans) if scan["default"]), None) for scans in said]
        when = sorted(k for k in first if k is not None)
        soon = f"{SCAN_S * (when[len(when) // 2] + 1):.0f} s" if when else ""
        rows.append([fault.name.removesuffix(" 0"), *shares, *over, soon])
    return table(["fault", *WAYS, *(f"default, {name}" for name in TERRAINS), "median time to alert"], rows)


def _found(flights: Sequence[Sequence[dict[str, bool]]], way: str) -> str:
    return share(sum(any(scan[way] for scan in scans[:WITHIN]) for scans in flights), len(flights))


def by_pairs(flown: Sequence[Flown], calibrations: dict[str, Calibration]) -> str:
    """Single scans over shifted terrain by the number of pairs, beside the minimum detectable bias."""
    rows = []
    for low, high in PAIRS:
        cells = []
        for shift in SHIFTS_M:
            scans = [
                (scan, calibrations[flight.kind.terrain])
                for flight in flown
                for scan in flight.samples[f"terrain shifted {shift} m"]
                if low <= len(scan.disparities) < high
            ]
            cells.append(share(sum(_by_test(scan, c)["default"] for scan, c in scans), len(scans)))
        mdb = minimum_detectable_bias((low + high) // 2, next(iter(calibrations.values())).rms_bins, P_FA, 1e-3)
        rows.append([f"{low} to {high - 1}", *cells, f"{mdb:.1f} bins, {mdb * BIN_M:.0f} m"])
    return table(["N_D of the scan", *(f"{shift} m" for shift in SHIFTS_M), "MDB of T"], rows)
