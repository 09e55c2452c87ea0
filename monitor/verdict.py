"""What the monitor answers for a scan, and what it rests on."""

from dataclasses import dataclass

OK, ALERT, UNAVAILABLE = "ok", "alert", "unavailable"


@dataclass(frozen=True)
class Verdict:
    """The answer for one scan, and the numbers behind it. Disparities are in range bins.

    `scans` is how many scans the pairs are from. `threshold` is that of the method's statistic, Q or N T / sigma^2.
    `mdb_bins` is the minimum detectable bias of the published test, with the plain rms of the calibration. `shift`, its
    limit and those of the unmatched shares are there by the robust method, with a calibration that has what they need
    and a budget. `offset_...` is
    `offset.Offset`, of an alert.
    """

    scan: int
    verdict: str
    reasons: tuple[str, ...]
    n_pairs: int
    scans: int
    t_bins2: float | None
    t_normalised: float | None
    q: float | None
    threshold: float | None
    mean_bins: float | None
    mean_stderr_bins: float | None
    shift: float | None
    shift_limit: float | None
    unmatched_radar: float | None
    unmatched_radar_limit: float | None
    unmatched_dem: float | None
    unmatched_dem_limit: float | None
    level: float | None
    mdb_bins: float | None
    calibration: str
    offset_north_m: float | None = None
    offset_east_m: float | None = None
    offset_confidence: float | None = None
