"""What a monitor remembers from scan to scan: pairs that are lent, to whom they are not, and what `forget` forgets."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monitor.aircraft import Aircraft
from monitor.calibration import Calibration, Limits
from monitor.integrity import Monitor
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from monitor.verdict import Verdict
from tests.monitor.scanning import CALIBRATED, MS, flying, moved

WINDOW = 4
NEEDED = 20
SECTOR = slice(10, 29)  # radials that have some pairs, and too few for a verdict
LEVEL = 3.0  # of the honest scan, where it is lit
LEVELS = Limits(lowest=LEVEL - 0.5, highest=LEVEL + 0.5)
# The clip is so wide that as many pairs as are needed can alert.
WIDE = CALIBRATED.model_copy(update={"level": LEVELS, "spread_bins": 3.0})
TOGETHER = "pairs of the last 2 scans together"
Seen = tuple[Scan, Aircraft]


def part(scan: Scan) -> Scan:
    return replace(
        scan,
        time_ns=scan.time_ns[SECTOR],
        scan_angle_deg=scan.scan_angle_deg[SECTOR],
        beyond_limits=scan.beyond_limits[SECTOR],
        bins=scan.bins[SECTOR],
    )


def monitor_of(terrain: Terrain, calibration: Calibration | None = WIDE, **settings: int) -> Monitor:
    return Monitor(terrain, MonitorSettings.model_validate({"offset_search_m": 0, **settings}), calibration)


def judged(monitor: Monitor, *seen: Seen, since: int = 0) -> list[Verdict]:
    """The verdicts on scans 5 ms apart, while the state of `flying` is good; `since` are how many came before."""
    return [
        monitor.judge(replace(scan, time_ns=scan.time_ns + later * 5 * MS), aircraft)[0]
        for later, (scan, aircraft) in enumerate(seen, since)
    ]


def alone(terrain: Terrain, *seen: Seen, calibration: Calibration | None = WIDE) -> list[Verdict]:
    """The verdicts of a monitor for each scan, of which none has another one before."""
    return [judged(monitor_of(terrain, calibration, window_scans=WINDOW), one)[0] for one in seen]


def underground(terrain: Terrain, honest: Scan) -> Seen:
    """The aircraft a hand's breadth below a summit: ground shows on all sides, and some of its shadows pair."""
    grid = terrain.grid
    inside = grid.height_m[200:-300, 300:-300]
    row, column = np.unravel_index(np.argmax(inside), inside.shape)
    latitude, longitude = grid.north_deg - (row + 200) * grid.row_deg, grid.west_deg + (column + 300) * grid.column_deg
    return honest, flying(latitude_deg=latitude, longitude_deg=longitude, height_m=float(inside[row, column]) - 0.1)


def too_dim(_: Terrain, honest: Scan) -> Seen:
    """What is lit has level 1 instead of 3, as with a gain that was turned down; its shadows are where they were."""
    some = part(honest)
    return replace(some, bins=some.bins // 3), flying()


def at_another_range(_: Terrain, honest: Scan) -> Seen:
    return replace(part(honest), range_nm=20.0), flying()


def test_scans_with_too_few_pairs_lend_them_to_the_next(white_mountains: Terrain, honest: Scan) -> None:
    one = part(honest), flying()
    first, second = judged(monitor_of(white_mountains, window_scans=WINDOW), one, one)
    assert first == alone(white_mountains, one)[0]
    assert (first.verdict, first.scans) == ("unavailable", 1)
    assert NEEDED / 2 <= first.n_pairs < NEEDED
    assert (second.verdict, second.scans, second.n_pairs) == ("ok", 2, 2 * first.n_pairs)
    assert second.reasons == (TOGETHER,)


@pytest.mark.parametrize(("between", "calibration"), [(underground, WIDE), (too_dim, WIDE), (at_another_range, None)])
def test_a_scan_that_does_not_belong_there_neither_lends_pairs_nor_borrows_any(
    white_mountains: Terrain,
    honest: Scan,
    between: Callable[[Terrain, Scan], Seen],
    calibration: Calibration | None,
) -> None:
    """Its own pairs with those of the scan before, or of the one behind it, would be enough."""
    good, other = (part(honest), flying()), between(white_mountains, honest)
    monitor = monitor_of(white_mountains, calibration, window_scans=WINDOW)
    *first, last = judged(monitor, good, other, good, good)
    assert first == alone(white_mountains, good, other, good, calibration=calibration)
    assert {verdict.scans for verdict in first} == {1}
    assert first[0].n_pairs + first[1].n_pairs >= NEEDED > max(verdict.n_pairs for verdict in first)
    assert (last.verdict, last.scans, last.n_pairs) == ("ok", 2, 2 * first[0].n_pairs)


def test_forgotten_scans_lend_nothing_and_track_nothing(white_mountains: Terrain, honest: Scan) -> None:
    one = part(honest), flying()
    windowed = monitor_of(white_mountains, window_scans=WINDOW)
    before = judged(windowed, one, one)
    windowed.forget()
    assert [verdict.scans for verdict in before] == [1, 2]
    assert judged(windowed, one, one, since=2) == before

    tracking = monitor_of(white_mountains, tracked_scans=2)
    first, second = judged(tracking, one, one)
    assert "of which there are 0" in first.reasons[-1]
    assert "of which there are 0" not in second.reasons[-1]
    tracking.forget()
    assert judged(tracking, one, since=2)[0] == first


def test_an_alert_that_stands_goes_on_standing_when_the_scans_before_are_forgotten(
    white_mountains: Terrain, honest: Scan
) -> None:
    monitor = monitor_of(white_mountains, clear_scans=3)
    wrong, right = (moved(honest, 12), flying()), (honest, flying())
    assert [verdict.verdict for verdict in judged(monitor, wrong, right)] == ["alert", "alert"]
    monitor.forget()
    second, third = judged(monitor, right, right)
    assert (second.verdict, second.reasons[0]) == (
        "alert",
        "within the thresholds for 2 of the 3 scans that clear the alert",
    )
    assert third.verdict == "ok"
    judged(monitor, wrong)
    assert judged(monitor.anew(), right)[0].verdict == "ok", "another recording has no part in it"
