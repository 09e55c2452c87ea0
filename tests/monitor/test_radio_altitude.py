"""The radio altimeter decides whether the monitor works, and where the radials begin: eq. (14) by hand, and a scan."""

from dataclasses import replace
from math import atan, degrees

import numpy as np
import pytest

from monitor.aircraft import Aircraft
from monitor.integrity import Monitor
from monitor.quantities import RADIO_HEIGHT
from monitor.radio_altitude import first_bins, too_high
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from tests.monitor.scanning import ANGLES, CALIBRATED, MS, NO_COMPUTED_DATA, flying, judge

N = len(ANGLES)
LIMITED = MonitorSettings(radio_altitude_limit_m=762.0)  # 2,500 ft
FROM_THERE = MonitorSettings(first_bin_from_radio_altitude=True)


def over_ground(*height_m: float, status: int = 0) -> Aircraft:
    """Radio altitudes at the beginning and end of 200 ms, or one for both."""
    aircraft = flying()
    both = np.array([height_m[0], height_m[-1]])
    aircraft.tracks[RADIO_HEIGHT.name].append(np.array([0, 200 * MS]), both, np.full(2, status, np.uint8))
    return aircraft


def test_flat_ground_begins_where_a_line_as_steep_as_the_lower_edge_meets_it() -> None:
    """A lower edge of 1 in 20 from 500 m meets the ground at 10 km: 100 bins of 100 m lie nearer, 40 of 250 m."""
    half_deg = 1.75
    gamma = np.radians([half_deg - degrees(atan(1 / 20)), half_deg - degrees(atan(1 / 10))])
    bins, told = first_bins(np.array([500.4, 500.4]), gamma, 2 * half_deg, 100.0)
    assert (bins.tolist(), told) == ([100, 50], [])
    assert first_bins(np.array([500.4]), gamma[:1], 2 * half_deg, 250.0)[0].tolist() == [40]
    assert first_bins(np.array([499.9]), gamma[:1], 2 * half_deg, 100.0)[0].tolist() == [99], "bin 100 holds the place"
    assert first_bins(np.array([-2.1]), gamma[:1], 2 * half_deg, 10.0)[0].tolist() == [4]


def test_a_lower_edge_that_does_not_look_down_never_meets_flat_ground() -> None:
    gamma = np.radians([1.75, 3.0, 1.74999])
    bins, told = first_bins(np.full(3, 500.0), gamma, 3.5, 36.0)
    assert bins[:2].tolist() == [0, 0]
    assert bins[2] > 500_000
    assert told == ["the beam's lower edge never meets flat ground on 2 of 3 radials: no bin is left out there"]


def test_above_the_limit_is_above_and_not_at_it() -> None:
    assert too_high(np.array([100.0, 762.0]), 762.0) is None
    assert too_high(np.array([100.0, 763.0]), 762.0) == (
        "radio altitude up to 763 m, the monitor works to 762 m: above on 1 of 2 radials"
    )


def test_above_the_limit_there_is_no_verdict_and_below_it_there_is(white_mountains: Terrain, honest: Scan) -> None:
    verdict, comparison = Monitor(white_mountains, LIMITED, CALIBRATED).judge(honest, over_ground(900.0))
    assert (verdict.verdict, comparison) == ("unavailable", None)
    assert verdict.reasons == (f"radio altitude up to 900 m, the monitor works to 762 m: above on {N} of {N} radials",)
    assert judge(white_mountains, honest, over_ground(700.0), settings=LIMITED)[0] == judge(white_mountains, honest)[0]
    assert judge(white_mountains, honest, over_ground(900.0))[0].verdict == "ok", "without a limit"


def test_a_climb_through_the_limit_within_the_scan_is_above_it(white_mountains: Terrain, honest: Scan) -> None:
    """700 to 800 m in 200 ms: the second half of the radials lies beyond 750 m."""
    climbing = replace(honest, time_ns=np.where(np.arange(N) < 31, 90 * MS, 110 * MS))
    settings = MonitorSettings(radio_altitude_limit_m=750.0)
    verdict, _ = Monitor(white_mountains, settings, CALIBRATED).judge(climbing, over_ground(700.0, 800.0))
    assert verdict.reasons == (f"radio altitude up to 755 m, the monitor works to 750 m: above on 30 of {N} radials",)


@pytest.mark.parametrize("settings", [LIMITED, FROM_THERE])
def test_a_radio_altitude_that_is_not_known_gives_no_verdict(
    white_mountains: Terrain, honest: Scan, settings: MonitorSettings
) -> None:
    monitor = Monitor(white_mountains, settings, CALIBRATED)
    for aircraft, status in ((over_ground(0, status=NO_COMPUTED_DATA), "NO_COMPUTED_DATA"), (flying(), "MISSING")):
        verdict, comparison = monitor.judge(honest, aircraft)
        assert (verdict.verdict, comparison) == ("unavailable", None)
        assert verdict.reasons == (f"radio_height_m: {status} on {N} of {N} radials",)


def test_both_threads_begin_where_the_lower_edge_meets_flat_ground(white_mountains: Terrain, honest: Scan) -> None:
    """Tilted 2 degrees down, 3.75 with half the beam: 300 m over ground is 300 / tan(3.75 deg) = 4,577 m, bin 127."""
    _, plain = judge(white_mountains, honest)
    verdict, comparison = judge(white_mountains, honest, over_ground(300.0), settings=FROM_THERE)
    assert (comparison.radar_states[:, :126] == -3).all()
    assert (comparison.dem_states[:, :126] == -3).all()
    np.testing.assert_array_equal(comparison.radar_states[:, 126:] > 0, plain.radar_states[:, 126:] > 0)
    np.testing.assert_array_equal(comparison.dem_states[:, 126:], plain.dem_states[:, 126:])
    assert (plain.radar_states[:, :126] > 0).any()
    assert (verdict.verdict, verdict.reasons) == ("ok", ())


def test_nothing_is_left_of_radials_that_begin_beyond_the_range_setting(white_mountains: Terrain, honest: Scan) -> None:
    verdict, comparison = judge(white_mountains, honest, over_ground(5000.0), settings=FROM_THERE)
    assert (comparison.radar_states == -3).all()
    assert (verdict.verdict, verdict.reasons) == ("unavailable", ("0 pairs of shadows, 20 needed",))


def test_a_beam_that_looks_up_leaves_no_bin_out_and_says_so(white_mountains: Terrain, honest: Scan) -> None:
    up = replace(honest, tilt_deg=1.75)
    verdict, comparison = judge(white_mountains, up, over_ground(300.0), settings=FROM_THERE)
    np.testing.assert_array_equal(comparison.radar_states, judge(white_mountains, up)[1].radar_states)
    assert (
        f"the beam's lower edge never meets flat ground on {N} of {N} radials: no bin is left out there"
        in verdict.reasons
    )
