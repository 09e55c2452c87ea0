"""From a scan, the aircraft's state and the terrain to a verdict with its reasons."""

from dataclasses import replace
from math import radians, sqrt

import numpy as np
import pytest
from pyproj import Geod
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, ncx2

from decoders.formats import MODES_708
from monitor.calibration import NO_CALIBRATION
from monitor.comparison import thin
from monitor.integrity import Monitor
from monitor.scans import Scan
from monitor.settings import LeverArm, MonitorSettings
from monitor.terrain import Terrain
from tests.monitor.scanning import ANGLES, HERE, TILT_DEG, flying, judge, lit, moved, scan_of

DEFAULTS_IN_USE = "no calibration loaded: stated defaults in use"


def test_radar_and_terrain_that_agree_are_ok(white_mountains: Terrain, honest: Scan) -> None:
    verdict, comparison = judge(white_mountains, honest)
    assert (verdict.scan, verdict.verdict, verdict.reasons, verdict.calibration) == (7, "ok", (), "test radar")
    assert verdict.n_pairs > 30
    assert (verdict.t_bins2, verdict.q, verdict.mean_bins, verdict.mean_stderr_bins) == (0, 0, 0, 0)
    assert (verdict.unmatched_radar, verdict.unmatched_dem) == (0, 0)
    assert comparison.scan_angle_deg.tolist() == ANGLES.tolist()


@pytest.mark.parametrize("bins", [-4, 4])
def test_echoes_moved_by_four_bins_alert_with_the_numbers_that_follow(
    white_mountains: Terrain, honest: Scan, bins: int
) -> None:
    """D = C_W - C_D, eq. (6), is positive for echoes farther than the terrain says; four bins are just not clipped."""
    verdict, comparison = judge(white_mountains, moved(honest, bins))
    n = verdict.n_pairs
    assert n == len(comparison.disparities) > 30
    assert comparison.disparities.tolist() == [bins] * n
    assert (verdict.t_bins2, verdict.mean_bins, verdict.mean_stderr_bins) == (16, bins, 0)
    assert verdict.q == pytest.approx(16 * n / 2.5**2)
    assert verdict.t_normalised == pytest.approx(16 * n / 5.0**2)
    assert verdict.threshold == pytest.approx(1.25 * float(chi2.isf(1e-4, n / 1.25)))
    assert verdict.verdict == "alert"
    assert verdict.reasons == (f"Q {verdict.q:.1f} exceeds {verdict.threshold:.1f}",)


def test_one_bin_is_no_alert(white_mountains: Terrain, honest: Scan) -> None:
    assert judge(white_mountains, moved(honest, 1))[0].verdict == "ok"


def test_the_paper_s_method_decides_by_n_t_over_sigma_squared(white_mountains: Terrain, honest: Scan) -> None:
    settings = MonitorSettings(method="paper", p_fa=1e-3)
    verdict, _ = judge(white_mountains, moved(honest, 4), settings=settings)
    assert verdict.threshold == pytest.approx(float(chi2.isf(1e-3, verdict.n_pairs)))
    assert verdict.t_normalised == pytest.approx(16 * verdict.n_pairs / 5.0**2)
    assert verdict.verdict == "ok"
    verdict, _ = judge(white_mountains, moved(honest, 8), settings=settings)
    assert verdict.verdict == "alert"
    assert verdict.reasons[0].startswith("N T / sigma^2 ")


def test_the_standard_error_of_the_mean_and_the_detectable_bias_are_stated(
    white_mountains: Terrain, honest: Scan
) -> None:
    uneven = replace(honest, bins=np.where(ANGLES[:, None] < 0, moved(honest, 2).bins, honest.bins))
    verdict, comparison = judge(white_mountains, uneven)
    n, farther = verdict.n_pairs, int(np.sum(comparison.disparities == 2))
    assert 0 < farther < n
    assert verdict.mean_bins == pytest.approx(2 * farther / n)
    variance = 4 * farther * (n - farther) / n / (n - 1)
    assert verdict.mean_stderr_bins == pytest.approx(sqrt(variance / n))
    assert verdict.mdb_bins is not None
    noncentrality = n * (verdict.mdb_bins / 5.0) ** 2  # the rms of the calibration, as in the published test
    assert float(ncx2.cdf(chi2.isf(1e-4, n), n, noncentrality)) == pytest.approx(1e-3, rel=1e-6)


def test_shadows_that_run_to_the_range_setting_stay_out_of_t(white_mountains: Terrain, honest: Scan) -> None:
    """Of each radial only the nearest echoes are left, so that every radar shadow runs to the end."""
    begun = np.logical_or.accumulate(honest.bins > 0, axis=1)
    ended = np.logical_or.accumulate(begun & (honest.bins == 0), axis=1)
    verdict, comparison = judge(white_mountains, replace(honest, bins=np.where(ended, 0, honest.bins).astype(np.uint8)))
    both_end_dark = (comparison.radar_states[:, -3:] == 0).all(axis=1) & (comparison.dem_states[:, -3:] == 0).all(
        axis=1
    )
    assert np.count_nonzero(both_end_dark) > 10
    assert verdict.n_pairs == 0


def test_every_verdict_without_a_calibration_says_so(white_mountains: Terrain, honest: Scan) -> None:
    silent = replace(honest, bins=np.zeros_like(honest.bins))
    found = [judge(white_mountains, scan, calibration=None)[0] for scan in (honest, moved(honest, 12), silent)]
    assert [verdict.verdict for verdict in found] == ["ok", "alert", "unavailable"]
    assert [verdict.reasons[-1] for verdict in found] == [DEFAULTS_IN_USE] * 3
    assert {verdict.calibration for verdict in found} == {NO_CALIBRATION}
    refused_too, _ = Monitor(white_mountains).judge(replace(honest, mode=MODES_708["weather"]), flying())
    assert refused_too.reasons[-1] == DEFAULTS_IN_USE


def test_without_a_calibration_nothing_is_ok_that_t_or_the_unmatched_shares_contradict(
    white_mountains: Terrain, honest: Scan
) -> None:
    """The defaults clip so wide that Q alone lets a quarter of grossly wrong pairs pass."""
    part = np.arange(len(ANGLES))[:, None] % 4 == 0
    torn = replace(honest, bins=np.where(part, moved(honest, 40).bins, honest.bins))
    verdict, _ = judge(white_mountains, torn, calibration=None)
    assert verdict.q is not None and verdict.threshold is not None and verdict.t_normalised is not None
    assert verdict.q < verdict.threshold < verdict.t_normalised
    assert verdict.verdict == "unavailable"
    assert "without a calibration no ok: N T / sigma^2" in verdict.reasons[0]

    alone = replace(honest, bins=np.where(np.arange(512) % 100 == 99, 0, honest.bins))
    alone.bins[:, 4:] *= np.arange(508) // 10 % 2 == 1  # shadows everywhere that no terrain casts
    verdict, _ = judge(white_mountains, alone, calibration=None, settings=MonitorSettings(minimum_pairs=2, p_fa=0.01))
    assert verdict.verdict != "ok"
    assert any("unmatched share of radar shadows" in reason for reason in verdict.reasons)


def test_too_few_pairs_are_unavailable_whatever_they_say(white_mountains: Terrain, honest: Scan) -> None:
    """Twenty pairs are needed at 1e-4; what was measured is told all the same."""
    few = slice(10, 25)
    part = replace(
        moved(honest, 12),
        time_ns=honest.time_ns[few],
        scan_angle_deg=ANGLES[few],
        beyond_limits=honest.beyond_limits[few],
        bins=moved(honest, 12).bins[few],
    )
    verdict, _ = judge(white_mountains, part)
    assert verdict.verdict == "unavailable"
    assert 2 < verdict.n_pairs <= 15
    assert verdict.reasons == (f"{verdict.n_pairs} pairs of shadows, 20 needed",)
    assert (verdict.q, verdict.threshold, verdict.mdb_bins, verdict.t_normalised) == (None, None, None, None)
    assert verdict.t_bins2 is not None
    assert verdict.unmatched_radar is not None
    lenient = MonitorSettings(minimum_pairs=2, p_fa=0.1)
    assert judge(white_mountains, part, settings=lenient)[0].verdict == "alert"


def test_pairs_that_could_not_alert_however_wrong_are_unavailable_and_never_good(
    white_mountains: Terrain, honest: Scan
) -> None:
    part = replace(honest, bins=np.where(np.arange(len(honest.bins))[:, None] < 3, honest.bins, 0))
    strict = MonitorSettings(minimum_pairs=2, p_fa=1e-9)
    verdict, _ = judge(white_mountains, part, settings=strict)
    assert verdict.verdict == "unavailable"
    assert "cannot alert at P_FA 1e-09" in verdict.reasons[0]


@pytest.mark.parametrize(("p_fa", "needed"), [(1e-3, 16), (1.01e-4, 16), (1e-4, 20), (1e-6, 20)])
def test_a_rarer_false_alert_needs_more_pairs(p_fa: float, needed: int) -> None:
    assert MonitorSettings(p_fa=p_fa).pairs_needed == needed
    assert MonitorSettings(p_fa=p_fa, minimum_pairs=5).pairs_needed == 5


def test_a_range_limit_cuts_both_threads_and_flags_what_it_cuts(white_mountains: Terrain, honest: Scan) -> None:
    _, comparison = judge(white_mountains, honest, settings=MonitorSettings(range_limit_nm=5.0))
    assert comparison.radar_states.shape == comparison.dem_states.shape == (61, 256)
    _, beyond = judge(white_mountains, honest, settings=MonitorSettings(range_limit_nm=50.0))
    assert beyond.radar_states.shape == (61, 512)


def test_half_degree_radials_count_once_per_beam(white_mountains: Terrain, honest: Scan) -> None:
    sixfold = np.arange(-90.0, 90.5, 0.5)
    nearest = np.round((sixfold + 90) / 3).astype(int)
    scan = scan_of(honest.bins[nearest], sixfold)
    assert judge(white_mountains, scan)[0] == judge(white_mountains, honest)[0]


def test_thinning_takes_the_radial_nearest_to_each_multiple_of_the_spacing() -> None:
    angles = np.array([-3.4, -2.9, -1.6, -0.2, 0.1, 1.4, 1.6, 3.2, 9.0])
    assert angles[thin(angles, 3.0)].tolist() == [-2.9, 0.1, 3.2, 9.0]
    assert thin(angles[::-1], 3.0).tolist() == [0, 1, 4, 7]
    assert thin(angles, 0.01).tolist() == list(range(9))
    assert not thin(np.empty(0), 3.0).size
    assert thin(np.full(50, 12.0), 3.0).tolist() == [0]
    assert len(thin(np.arange(-180.0, 180.0), 3.0)) == 120, "179 and -180 are neighbours"


def test_the_lever_arm_puts_the_antenna_where_it_is(white_mountains: Terrain, honest: Scan) -> None:
    """Below the GNSS antenna, and ahead of it along the heading."""
    low = MonitorSettings(lever_arm=LeverArm(down_m=40))
    assert judge(white_mountains, honest, flying(height_m=801.0), settings=low)[0].t_bins2 == 0
    lon, lat, _ = Geod(ellps="WGS84").fwd(HERE["longitude_deg"], HERE["latitude_deg"], HERE["heading_deg"] + 180, 90)
    behind = flying(latitude_deg=lat, longitude_deg=lon)
    ahead = MonitorSettings(lever_arm=LeverArm(forward_m=90))
    assert judge(white_mountains, honest, behind, settings=ahead)[0].t_bins2 == 0
    assert judge(white_mountains, honest, behind)[0].t_bins2 != 0


def test_an_unstabilised_antenna_looks_where_a_stabilised_one_does_in_level_flight(
    white_mountains: Terrain, honest: Scan
) -> None:
    _, comparison = judge(white_mountains, replace(honest, stabilised=False))
    np.testing.assert_array_equal(comparison.dem_states, judge(white_mountains, honest)[1].dem_states)


def test_a_stabilised_antenna_does_not_feel_the_attitude(white_mountains: Terrain, honest: Scan) -> None:
    verdict, _ = judge(white_mountains, honest, flying(roll_deg=15.0, pitch_deg=4.0))
    assert verdict.t_bins2 == 0


def test_an_unstabilised_antenna_turns_with_the_aircraft(white_mountains: Terrain, honest: Scan) -> None:
    """The boresight in the body, turned by Rz(heading) Ry(pitch) Rx(roll) into north, east, down."""
    roll, pitch = 12.0, 3.0
    angle, tilt = np.radians(ANGLES), radians(TILT_DEG)
    body = np.c_[np.cos(tilt) * np.cos(angle), np.cos(tilt) * np.sin(angle), np.full(len(ANGLES), -np.sin(tilt))]
    north, east, down = Rotation.from_euler("ZYX", [HERE["heading_deg"], pitch, roll], degrees=True).apply(body).T
    expected = lit(white_mountains, np.arctan2(east, north), np.arcsin(-down))
    banked = flying(roll_deg=roll, pitch_deg=pitch)
    _, comparison = judge(white_mountains, replace(honest, stabilised=False), banked)
    np.testing.assert_array_equal(comparison.dem_states, expected)
    # Right wing down: the beam meets the ground on the right and the sky on the left.
    right, left = comparison.dem_states[ANGLES > 60] > 0, comparison.dem_states[ANGLES < -60] > 0
    assert right.any()
    assert np.count_nonzero(left) < np.count_nonzero(right) / 10
