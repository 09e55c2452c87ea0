"""What a person at a terminal reads of a verdict."""

from dataclasses import replace

from gateway.console import describe
from gateway.events import IntegrityEvent

ALERT = IntegrityEvent(
    time_ns=0,
    sequence=1,
    method="robust",
    p_fa=1e-4,
    scan=7,
    verdict="alert",
    reasons=("the shift statistic 41.2 exceeds 19.4",),
    n_pairs=33,
    scans=1,
    t_bins2=30.25,
    t_normalised=40.0,
    q=60.5,
    threshold=90.0,
    mean_bins=0.5,
    mean_stderr_bins=0.25,
    shift=41.25,
    shift_limit=19.5,
    unmatched_radar=0.5,
    unmatched_radar_limit=None,
    unmatched_dem=0.125,
    unmatched_dem_limit=0.5,
    level=2.0,
    mdb_bins=9.0,
    calibration="made",
    offset_north_m=-200.0,
    offset_east_m=100.0,
    offset_confidence=0.75,
)


def test_a_verdict_says_each_test_against_what_it_may_reach_and_why() -> None:
    assert describe(ALERT) == (
        "scan 7: ALERT  N 33  T 30.2 bins2  Q 60.5 against 90.0  S 41.2 against 19.5  unmatched 12% against 50%  "
        "off by -200 m north, +100 m east (75%)  the shift statistic 41.2 exceeds 19.4"
    )


def test_a_test_that_there_was_not_is_left_out() -> None:
    bare = replace(ALERT, shift=None, unmatched_dem_limit=None, offset_north_m=None, method="paper")
    assert describe(bare) == (
        "scan 7: ALERT  N 33  T 30.2 bins2  N T / sigma^2 40.0 against 90.0  the shift statistic 41.2 exceeds 19.4"
    )
    assert describe(replace(bare, q=None, verdict="unavailable", reasons=("3 pairs of shadows, 16 needed",))) == (
        "scan 7: UNAVAILABLE  3 pairs of shadows, 16 needed"
    )
