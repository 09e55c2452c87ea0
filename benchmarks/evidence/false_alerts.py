"""How often each test alerts when nothing is wrong, against the probability that was asked for."""

from collections.abc import Callable, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from benchmarks.evidence.flown import Flown
from benchmarks.evidence.tables import rate, table
from monitor.calibration import Calibration
from monitor.decision import DEM_SHARE, Test, examine, shift_test, unmatched_test
from monitor.disparity import robust_statistic
from monitor.fitting import fit
from monitor.sample import ScanSample
from monitor.settings import MonitorSettings

P_FAS = (1e-1, 1e-2, 1e-3)
MINIMUM_PAIRS = 16
DRAWS = 20_000
SIGNIFICANCE = 0.01

DEFAULT = "the default: Q, shift and unmatched terrain shadows"

Alerts = Callable[[ScanSample, float], bool]


def scans_of(flown: Sequence[Flown], fault: str = "none 0") -> list[ScanSample]:
    """All scans of the flights that have enough pairs."""
    every = chain.from_iterable(flight.samples[fault] for flight in flown)
    return [scan for scan in every if len(scan.disparities) >= MINIMUM_PAIRS]


def calibrated(flown: Sequence[Flown], name: str) -> Calibration:
    """A calibration from flights: every second one fits, the others check."""
    fitting, checking = scans_of(flown[::2]), scans_of(flown[1::2])
    settings = MonitorSettings(minimum_pairs=MINIMUM_PAIRS)
    return fit(
        fitting,
        checking,
        P_FAS,
        settings,
        name=name,
        provenance="evidence",
        bins=512,
        range_nm=10.0,
        radar_profile="arinc708",
    )


def tests(calibration: Calibration, pool: Sequence[ScanSample]) -> dict[str, Alerts]:
    """Each way to decide, by name."""
    return {
        "T as published": _decision(calibration, method="paper"),
        "Q": _decision(calibration, shift_budget=0.0, unmatched_dem_budget=0.0),
        DEFAULT: _decision(calibration),
        "the shift statistic": lambda scan, p_fa: found(shift_test(scan, calibration, p_fa)),
        "unmatched terrain shadows": lambda scan, p_fa: found(unmatched(scan, calibration, p_fa)),
        "Q against a bootstrap": Bootstrap(calibration, pool),
    }


def found(test: Test | None) -> bool:
    """Whether a test that could be made exceeds its limit."""
    return test is not None and test.exceeded


def unmatched(scan: ScanSample, calibration: Calibration, p_fa: float) -> Test | None:
    """The test of unmatched terrain shadows alone."""
    return unmatched_test(DEM_SHARE, scan.unmatched_dem, calibration.unmatched_dem, p_fa)


def _decision(calibration: Calibration, **options: str | float) -> Alerts:
    def alerts(scan: ScanSample, p_fa: float) -> bool:
        settings = MonitorSettings.model_validate({"p_fa": p_fa, "minimum_pairs": MINIMUM_PAIRS, **options})
        return bool(examine(scan, settings, calibration).alerts)

    return alerts


class Bootstrap:
    """The empirical threshold of Q: disparities of one fault-free scan drawn again and again, with replacement."""

    def __init__(self, calibration: Calibration, pool: Sequence[ScanSample]) -> None:
        self._calibration = calibration
        self._pool = [scan.disparities for scan in pool]
        self._drawn: dict[int, NDArray[np.float64]] = {}

    def __call__(self, scan: ScanSample, p_fa: float) -> bool:
        """Whether Q of a scan is above all but that share of those drawn."""
        n = len(scan.disparities)
        if n not in self._drawn:
            rng = np.random.default_rng(n)
            picks = rng.integers(len(self._pool), size=DRAWS)
            self._drawn[n] = np.array([self._q(rng.choice(self._pool[k], n)) for k in picks])
        return self._q(scan.disparities) > float(np.quantile(self._drawn[n], 1 - p_fa))

    def _q(self, d: NDArray[np.float64]) -> float:
        c = self._calibration
        return robust_statistic(d, c.median_bins, c.clip_bins, c.sigma_bins)


def rows(name: str, scans: Sequence[ScanSample], ways: dict[str, Alerts]) -> list[list[str]]:
    """A row for each way to decide, with the rate at each P_FA and whether it is what was asked for."""
    found = []
    for way, alerts in ways.items():
        counts = [sum(alerts(scan, p_fa) for scan in scans) for p_fa in P_FAS]
        found.append([name, way, *(rate(count, len(scans)) for count in counts), _held(counts, len(scans))])
    return found


def _held(counts: Sequence[int], scans: int) -> str:
    """Whether no rate is more than chance above what was asked for, and else by how much."""
    too_many = [
        f"{count / scans / p_fa:.1f} times at {p_fa:g}"
        for count, p_fa in zip(counts, P_FAS, strict=True)
        if scans and count > binom.ppf(1 - SIGNIFICANCE, scans, p_fa)
    ]
    return f"no: {', '.join(too_many)}" if too_many else "yes"


def page(measured: Sequence[list[str]]) -> str:
    """The rows as a table."""
    asked = [f"P_FA {p_fa:g}" for p_fa in P_FAS]
    return table(["flights, and what calibrated the monitor", "decided by", *asked, "honest"], measured)
