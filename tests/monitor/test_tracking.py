"""Shadows over scans: ridges that stand still count, what keeps its range does not; worked by hand over a plain."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Geod

from decoders.formats import MODES_708
from monitor import warmup
from monitor.aircraft import Aircraft
from monitor.comparison import Comparison
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.prediction import Pointing
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import radar_states, shadows
from monitor.terrain import Grid, Terrain
from monitor.tracking import ShadowTracker, front_points
from monitor.verdict import Verdict
from tests.monitor.ground import LATITUDE, LONGITUDE, looking_north, plain

GEOD = Geod(ellps="WGS84")
SECOND_NS = 1_000_000_000
ANGLES = np.arange(-3.0, 3.5, 0.5)  # three of which are in use, 3 degrees apart
HEIGHT_M, RANGE_NM = 300.0, 5.0
BIN_M = RANGE_NM * 1852 / 512
RIDGE_M = 6000.0  # north of where the aircraft begins, from east to west
CONSTANT = 100  # the front's bin of a shadow that keeps its range
SWEEP_S, STEP_M = 4, 200.0
PLAIN = Terrain(plain(), [], "")
IN_USE = 3


def flying(moved_m: float, time_ns: int) -> Aircraft:
    """Northward over the plain at 44 N, so many metres from the beginning."""
    _, latitude, _ = GEOD.fwd(LONGITUDE, LATITUDE, 0, moved_m)
    values = {"latitude_deg": latitude, "longitude_deg": LONGITUDE, "height_m": HEIGHT_M}
    aircraft = Aircraft()
    for quantity in NEEDED:
        value = np.full(2, values.get(quantity.name, 0.0))
        aircraft.tracks[quantity.name].append(time_ns + np.array([-1, 1]), value, np.zeros(2, np.uint8))
    return aircraft


def scan_at(moved_m: float, time_ns: int, angles: NDArray[np.float64] = ANGLES) -> Scan:
    """Everything lit but 10 bins behind the ridge and 10 at a constant range."""
    bins = np.full((len(angles), 512), 3, np.uint8)
    for radial, angle in zip(bins, angles, strict=True):
        radial[CONSTANT : CONSTANT + 10] = 0
        if np.isfinite(angle):
            slant_m = np.hypot((RIDGE_M - moved_m) / np.cos(np.radians(angle)), HEIGHT_M)
            front = int(slant_m / BIN_M) + 1
            radial[front : front + 10] = 0
    n = len(angles)
    return Scan(
        number=1,
        time_ns=np.full(n, time_ns),
        scan_angle_deg=angles,
        beyond_limits=np.zeros(n, bool),
        bins=bins,
        tilt_deg=-2.0,
        range_nm=RANGE_NM,
        mode=MODES_708["map"],
        stabilised=True,
        faults=0,
        missing=0,
        repeated=0,
    )


def monitor_of(scans: int, **more: float) -> Monitor:
    asked = {"tracked_scans": scans, "position_gate": False, **more}
    return Monitor(PLAIN, MonitorSettings.model_validate(asked))


def judge(monitor: Monitor, number: int, step_m: float = STEP_M, time_ns: int | None = None) -> str:
    """What is said of the shadows that do not count in a scan so many sweeps from the beginning."""
    time_ns = (1 + number * SWEEP_S) * SECOND_NS if time_ns is None else time_ns
    verdict, _ = monitor.judge(scan_at(number * step_m, time_ns), flying(number * step_m, time_ns))
    return said(verdict)


def said(verdict: Verdict) -> str:
    return "; ".join(reason for reason in verdict.reasons if "do not count" in reason)


def none_before(scans: int, have: int) -> str:
    every = 2 * IN_USE
    return (
        f"{every} radar and 0 terrain shadows do not count: no front there in each of {scans} scans before, "
        f"of which there are {have}"
    )


def kept_its_range(scans: int) -> str:
    return f"{IN_USE} radar and 0 terrain shadows do not count: no front there in each of {scans} scans before"


def test_a_ridge_counts_from_the_second_scan_on_and_what_keeps_its_range_never() -> None:
    monitor = monitor_of(2)
    assert judge(monitor, 0) == none_before(1, 0)
    assert [judge(monitor, number) for number in range(1, 5)] == [kept_its_range(1)] * 4


def test_every_one_of_the_scans_before_must_have_the_front() -> None:
    monitor = monitor_of(3)
    assert [judge(monitor, number) for number in range(2)] == [none_before(2, 0), none_before(2, 1)]
    assert [judge(monitor, number) for number in range(2, 4)] == [kept_its_range(2)] * 2
    flat, time_ns = scan_at(0, 0), (1 + 4 * SWEEP_S) * SECOND_NS
    blank = replace(flat, bins=np.full_like(flat.bins, 3), time_ns=np.full(len(ANGLES), time_ns))
    monitor.judge(blank, flying(4 * STEP_M, time_ns))
    every = f"{2 * IN_USE} radar and 0 terrain shadows do not count: no front there in each of 2 scans before"
    assert [judge(monitor, number) for number in range(5, 8)] == [every, every, kept_its_range(2)]


def test_nothing_moves_for_an_aircraft_that_stands_or_a_tolerance_as_long_as_its_way() -> None:
    standing = monitor_of(2)
    judge(standing, 0, step_m=0)
    assert judge(standing, 1, step_m=0) == ""
    for tolerance_m, expected in ((STEP_M + BIN_M, ""), (STEP_M - BIN_M, kept_its_range(1))):
        monitor = monitor_of(2, tracking_tolerance_m=tolerance_m)
        judge(monitor, 0)
        assert judge(monitor, 1) == expected


def test_without_tracking_every_shadow_counts() -> None:
    assert [judge(Monitor(PLAIN, MonitorSettings(position_gate=False)), number) for number in range(3)] == [""] * 3


def test_a_clock_that_began_anew_or_was_long_silent_leaves_no_scan_before() -> None:
    for later_ns, expected in (
        (20 * SECOND_NS, kept_its_range(1)),
        (20 * SECOND_NS + 1, none_before(1, 0)),
        (-1, none_before(1, 0)),
    ):
        monitor = monitor_of(2)
        judge(monitor, 0, time_ns=100 * SECOND_NS)
        assert judge(monitor, 1, time_ns=100 * SECOND_NS + later_ns) == expected


def test_a_monitor_anew_has_no_scan_before_and_takes_none_away() -> None:
    monitor = monitor_of(2)
    judge(monitor, 0)
    assert judge(monitor.anew(), 1) == none_before(1, 0)
    assert judge(monitor, 1) == kept_its_range(1)


def test_radials_without_an_angle_or_a_state_do_not_count_and_break_nothing() -> None:
    monitor = monitor_of(2)
    angles = ANGLES.copy()
    angles[[0, 5]] = np.nan
    monitor.judge(scan_at(0, SECOND_NS, angles), flying(0, SECOND_NS))
    assert judge(monitor, 1) == kept_its_range(1)
    unknown = scan_at(2 * STEP_M, 9 * SECOND_NS)
    verdict, comparison = monitor.judge(unknown, flying(0, SECOND_NS))
    assert (verdict.verdict, comparison) == ("unavailable", None)
    time_ns = 13 * SECOND_NS
    verdict, _ = monitor.judge(scan_at(3 * STEP_M, time_ns, angles), flying(3 * STEP_M, time_ns))
    assert said(verdict) == kept_its_range(1), "-2.5 degrees stand for -3"


@pytest.mark.parametrize("longitude", [LONGITUDE, 179.999])
def test_chords_between_fronts_are_distances_on_the_ground(longitude: float) -> None:
    """Fronts 5 km away at 90 and 80 degrees over a plain, in the second case beyond the antimeridian."""
    west = longitude - 0.2
    grid = Grid(np.zeros((1200, 1440), np.float32), 44.3, west, 1 / 3600, 1 / 3600)
    one = np.ones(2)
    pointing = Pointing(LATITUDE * one, longitude * one, 300 * one, np.radians([90.0, 80.0]), 0 * one)
    bins = np.ones((2, 200), np.uint8)
    bins[:, 100:110] = 0
    points = front_points(shadows(radar_states(bins), "radar"), pointing, grid, 50.0)
    along_m = np.sqrt((99.5 * 50) ** 2 - 300**2)
    ends = [GEOD.fwd(longitude, LATITUDE, azimuth, along_m)[:2] for azimuth in (90, 80)]
    assert np.linalg.norm(points[0] - points[1]) == pytest.approx(GEOD.inv(*ends[0], *ends[1])[2], abs=0.1)


def test_scans_without_a_front_are_scans_all_the_same() -> None:
    tracker = ShadowTracker(3)
    nothing = front_points(shadows(np.ones((1, 4), np.int8), "radar"), looking_north(100.0), plain(), 10.0)
    tracker.add(0, nothing)
    tracker.add(1, np.full((2, 3), np.nan))
    (first, second) = tracker.before(2)
    assert first.hold(np.zeros((2, 3)), 1.0).tolist() == second.hold(np.zeros((2, 3)), 1.0).tolist() == [False, False]
    tracker.add(2, np.zeros((1, 3)))
    assert [fronts.time_ns for fronts in tracker.before(3)] == [1, 2]
    assert tracker.before(3)[1].hold(np.array([[3.0, 4, 0], [3, 4, 1e-3], [np.nan] * 3]), 5.0).tolist() == [
        True, False, False,
    ]  # fmt: skip


def test_a_monitor_of_every_option_is_warmed_up_by_a_whole_comparison(
    white_mountains: Terrain, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A made-up scan that one of the options refuses would leave kernels to be compiled while the first scan waits."""
    compared: list[Comparison | None] = []

    class Watched(Monitor):
        def judge(self, scan: Scan, aircraft: Aircraft) -> tuple[Verdict, Comparison | None]:
            verdict, comparison = super().judge(scan, aircraft)
            compared.append(comparison)
            return verdict, comparison

    monkeypatch.setattr(warmup, "Monitor", Watched)
    settings = MonitorSettings(
        tracked_scans=2, minimum_width_deg=3, radio_altitude_limit_m=762, first_bin_from_radio_altitude=True
    )
    monitor = Monitor(white_mountains, settings)
    warmup.warm_up(monitor)
    assert [bool(one) for one in compared] == [True]
    assert not monitor._tracker._before
