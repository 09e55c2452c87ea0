"""What the monitor answers for a scan, and what it rests on."""

from dataclasses import dataclass

OK, ALERT, UNAVAILABLE = "ok", "alert", "unavailable"


@dataclass(frozen=True)
class Verdict:
    """The answer for one scan, and the numbers behind it. Disparities are in range bins.

    `mdb_bins` is the minimum detectable bias of the published test, with the plain rms of the calibration.
    """

    scan: int
    verdict: str
    reasons: tuple[str, ...]
    n_pairs: int
    t_bins2: float | None
    t_normalised: float | None
    q: float | None
    threshold: float | None
    mean_bins: float | None
    mean_stderr_bins: float | None
    unmatched_radar: float | None
    unmatched_dem: float | None
    mdb_bins: float | None
    calibration: str
