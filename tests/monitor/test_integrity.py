"""From a scan, the aircraft's state and the terrain to a verdict with its reasons.

The echoes are the monitor's own prediction, moved by a known number of range bins: what is tested here is the decision,
and the prediction has tests of its own.
"""

from dataclasses import replace
from math import radians, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Geod
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, ncx2

from decoders.formats import MODES_708
from monitor.aircraft import Aircraft
from monitor.calibration import NO_CALIBRATION, Calibration
from monitor.comparison import Comparison, thin
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.prediction import Beam, Pointing, predict
from monitor.quantities import GNSS_MODE, INTEGRITY_LIMIT, SATELLITE_FAILURE
from monitor.scans import Scan
from monitor.settings import LeverArm, MonitorSettings
from monitor.terrain import Terrain
from monitor.track import Track
from monitor.verdict import Verdict

MS = 1_000_000
ANGLES = np.arange(-90.0, 91.0, 3.0)
HERE = {"latitude_deg": 44.37514, "longitude_deg": -71.71874, "height_m": 761.0, "heading_deg": 197.6}
TILT_DEG = -2.0
FAN_DEG = Beam().azimuth_span * Beam().width_deg
NO_COMPUTED_DATA = 1
CALIBRATED = Calibration(
    name="test radar",
    provenance="made up",
    bins=512,
    range_nm=10.0,
    median_bins=0.0,
    spread_bins=2.0,
    sigma_bins=2.5,
    rms_bins=5.0,
    variance_factor=1.25,
)
DEFAULTS_IN_USE = "no calibration loaded: stated defaults in use"


NAVIGATION = 0b01100
VOUCHED = {"gnss_mode": NAVIGATION, "horizontal_integrity_limit_m": 185.2, "gnss_satellite_failure": 0.0}


def flying(**changed: float) -> Aircraft:
    """Level flight over the White Mountains, with a sample of everything 100 ms before and after the scan."""
    aircraft = Aircraft()
    for quantity in (*NEEDED, GNSS_MODE, INTEGRITY_LIMIT, SATELLITE_FAILURE):
        value = {**HERE, **VOUCHED, **changed}.get(quantity.name, 0.0)
        aircraft.tracks[quantity.name].append(np.array([0, 200 * MS]), np.full(2, value), np.zeros(2, np.uint8))
    return aircraft


def lit(terrain: Terrain, azimuth: NDArray[np.float64], elevation: NDArray[np.float64]) -> NDArray[np.int8]:
    latitude, longitude, height = (
        np.full(len(azimuth), HERE[name]) for name in ("latitude_deg", "longitude_deg", "height_m")
    )
    pointing = Pointing(latitude, longitude, height, azimuth, elevation)
    states, void = predict(terrain.grid, pointing, 512, 18_520 / 512, Beam())
    assert not void.any()
    return states


def scan_of(echoes: NDArray[np.uint8], angles: NDArray[np.float64] = ANGLES) -> Scan:
    n = len(angles)
    return Scan(
        number=7,
        time_ns=np.full(n, 100 * MS),
        scan_angle_deg=angles,
        beyond_limits=np.zeros(n, bool),
        bins=echoes,
        tilt_deg=TILT_DEG,
        range_nm=10.0,
        mode=MODES_708["map"],
        stabilised=True,
        faults=0,
        missing=0,
        repeated=0,
    )


@pytest.fixture(scope="module")
def honest(white_mountains: Terrain) -> Scan:
    """A scan that agrees with the terrain to the bin."""
    states = lit(white_mountains, np.radians(HERE["heading_deg"] + ANGLES), np.full(len(ANGLES), radians(TILT_DEG)))
    return scan_of(3 * (states > 0).astype(np.uint8))


def moved(scan: Scan, bins: int) -> Scan:
    """Every echo so many bins farther out; the first bins go dark."""
    echoes = np.roll(scan.bins, bins, axis=1)
    echoes[:, slice(bins) if bins > 0 else slice(bins, None)] = 0
    return replace(scan, bins=echoes)


def judge(
    terrain: Terrain,
    scan: Scan,
    aircraft: Aircraft | None = None,
    calibration: Calibration | None = CALIBRATED,
    settings: MonitorSettings | None = None,
) -> tuple[Verdict, Comparison]:
    verdict, comparison = Monitor(terrain, settings, calibration).judge(scan, aircraft or flying())
    assert comparison is not None
    return verdict, comparison


def refused(terrain: Terrain, scan: Scan, aircraft: Aircraft | None = None) -> str:
    """The only reason of a scan that allows no comparison."""
    verdict, comparison = Monitor(terrain, None, CALIBRATED).judge(scan, aircraft or flying())
    assert comparison is None
    assert (verdict.verdict, verdict.n_pairs, verdict.q, verdict.t_bins2) == ("unavailable", 0, None, None)
    (reason,) = verdict.reasons
    return reason


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


def test_a_radar_that_reports_a_fault_is_refused(white_mountains: Terrain, honest: Scan) -> None:
    assert "faults: bits 1000000" in refused(white_mountains, replace(honest, faults=1 << 6))


def test_no_echo_at_all_is_unavailable_and_never_good(white_mountains: Terrain, honest: Scan) -> None:
    verdict, _ = judge(white_mountains, replace(honest, bins=np.zeros_like(honest.bins)))
    assert (verdict.verdict, verdict.n_pairs, verdict.t_bins2, verdict.mean_bins) == ("unavailable", 0, None, None)
    assert verdict.reasons == ("0 pairs of shadows, 20 needed",)
    assert (verdict.unmatched_radar, verdict.unmatched_dem) == (None, None)


@pytest.mark.parametrize(("p_fa", "needed"), [(1e-3, 16), (1.01e-4, 16), (1e-4, 20), (1e-6, 20)])
def test_a_rarer_false_alert_needs_more_pairs(p_fa: float, needed: int) -> None:
    assert MonitorSettings(p_fa=p_fa).pairs_needed == needed
    assert MonitorSettings(p_fa=p_fa, minimum_pairs=5).pairs_needed == 5


@pytest.mark.parametrize("mode", ["weather", "standby", "test"])
def test_a_radar_that_does_not_map_is_refused(white_mountains: Terrain, honest: Scan, mode: str) -> None:
    reason = refused(white_mountains, replace(honest, mode=MODES_708[mode]))
    assert f"mode {MODES_708[mode]}, not map" in reason


def test_a_range_setting_where_shadows_mean_nothing_is_refused(white_mountains: Terrain, honest: Scan) -> None:
    assert "160 NM is beyond 80 NM" in refused(white_mountains, replace(honest, range_nm=160.0))


def test_a_calibration_for_another_radar_or_range_is_refused(white_mountains: Terrain, honest: Scan) -> None:
    coarse = replace(honest, bins=honest.bins[:, ::2])
    assert "test radar is for 512 range bins, the radar sends 256" in refused(white_mountains, coarse)
    farther = replace(honest, range_nm=20.0)
    assert "test radar is for a range of 10 NM, the radar is set to 20 NM" in refused(white_mountains, farther)


@pytest.mark.parametrize("name", [quantity.name for quantity in NEEDED])
def test_a_missing_quantity_is_named(white_mountains: Terrain, honest: Scan, name: str) -> None:
    aircraft = flying()
    aircraft.tracks[name] = Aircraft().tracks[name]
    assert refused(white_mountains, honest, aircraft) == f"{name}: MISSING on 61 of 61 radials"


def test_radials_whose_state_is_invalid_are_left_out_and_named(white_mountains: Terrain, honest: Scan) -> None:
    aircraft = flying()
    later = np.array([250, 400]) * MS
    aircraft.tracks["roll_deg"].append(later, np.zeros(2), np.array([NO_COMPUTED_DATA, 0], np.uint8))
    times = np.where(ANGLES < 60, 100, 225) * MS
    verdict, comparison = judge(white_mountains, replace(honest, time_ns=times), aircraft)
    assert comparison.scan_angle_deg.max() == 57
    assert verdict.verdict == "ok"
    assert verdict.reasons == ("roll_deg: NO_COMPUTED_DATA on 11 of 61 radials",)


def test_a_stale_state_is_named(white_mountains: Terrain, honest: Scan) -> None:
    late = replace(honest, time_ns=np.full(len(ANGLES), 500 * MS))
    verdict, _ = Monitor(white_mountains, None, CALIBRATED).judge(late, flying())
    assert verdict.reasons == tuple(
        f"{name}: STALE on 61 of 61 radials" for name in ("pitch_deg", "roll_deg", "heading_deg")
    )


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ({"gnss_mode": 0b01000}, "the GNSS receiver's mode is acquisition"),
        ({"gnss_mode": 0b11111}, "the GNSS receiver's mode is fault"),
        ({"horizontal_integrity_limit_m": 16 * 1852 * (1 - 2**-17)}, "integrity limit is 15.9999 NM, above 0.3"),
        ({"horizontal_integrity_limit_m": 0.31 * 1852}, "integrity limit is 0.31 NM, above 0.3"),
        ({"horizontal_integrity_limit_m": 2458 * 16 / 2**17 * 1852}, "integrity limit is 0.300049 NM, above 0.3"),
        ({"gnss_satellite_failure": 1.0}, "has detected a satellite failure"),
    ],
)
def test_a_position_that_the_receiver_does_not_vouch_for_gives_no_verdict(
    white_mountains: Terrain, honest: Scan, said: dict[str, float], why: str
) -> None:
    reason = refused(white_mountains, honest, flying(**said))
    assert why in reason
    assert f"on {len(ANGLES)} of {len(ANGLES)} radials" in reason
    trusting = MonitorSettings(position_gate=False)
    assert judge(white_mountains, honest, flying(**said), settings=trusting)[0].verdict == "ok"


@pytest.mark.parametrize("mode", [0b01100, 0b01101, 0b01111, 0b10000, 0b11000])
def test_every_mode_that_navigates_is_good_enough(white_mountains: Terrain, honest: Scan, mode: int) -> None:
    assert judge(white_mountains, honest, flying(gnss_mode=mode))[0].verdict == "ok"


def test_a_receiver_that_never_says_its_mode_or_limit_is_not_vouched_for(
    white_mountains: Terrain, honest: Scan
) -> None:
    aircraft = flying()
    for name in VOUCHED:
        aircraft.tracks[name] = Track(aircraft.tracks[name].quantity)
    verdict, _ = Monitor(white_mountains, None, CALIBRATED).judge(honest, aircraft)
    assert verdict.verdict == "unavailable"
    assert [reason.partition(":")[0] for reason in verdict.reasons] == list(VOUCHED)
    assert all("MISSING" in reason for reason in verdict.reasons)


def test_radials_beyond_the_stabilisation_s_limits_are_refused(white_mountains: Terrain, honest: Scan) -> None:
    verdict, comparison = judge(white_mountains, replace(honest, beyond_limits=ANGLES >= 30))
    assert verdict.reasons == ("21 radials have attitude or tilt beyond limits",)
    assert comparison.scan_angle_deg.max() == 27
    everywhere = replace(honest, beyond_limits=np.ones(len(ANGLES), bool))
    assert refused(white_mountains, everywhere) == "61 radials have attitude or tilt beyond limits"


def test_radials_that_leave_the_terrain_are_counted(white_mountains: Terrain, honest: Scan) -> None:
    """9.3 km from the western border of the cell, radials of 18.5 km leave it on one side."""
    longitude = float(Geod(ellps="WGS84").fwd(-72.0, HERE["latitude_deg"], 90, 9_300)[0])
    verdict, comparison = judge(white_mountains, honest, flying(longitude_deg=longitude, heading_deg=180.0))
    lost = int(np.sum(18_520 * np.sin(np.radians(ANGLES + FAN_DEG)) > 9_300))  # the fan's edge leaves first
    assert len(comparison.scan_angle_deg) == 61 - lost
    assert f"{lost} radials leave the terrain or cross voids" in verdict.reasons


def test_an_aircraft_outside_the_stored_terrain_is_named_with_what_the_files_cover(
    white_mountains: Terrain, honest: Scan
) -> None:
    for place, said in (({"latitude_deg": 43.9}, "43.900 -71.719"), ({"longitude_deg": 71.71874}, "44.375 71.719")):
        verdict, _ = judge(white_mountains, honest, flying(**place))
        assert verdict.verdict == "unavailable"
        assert "61 radials leave the terrain or cross voids" in verdict.reasons
        assert (
            f"the aircraft, at {said}, is outside the stored terrain, latitudes 44.000 to 45.000 "
            "and longitudes -72.000 to -71.000: name the files of where it flies"
        ) in verdict.reasons


def test_a_gap_in_the_terrain_below_the_aircraft_is_named_and_a_gap_elsewhere_is_not(
    white_mountains: Terrain, honest: Scan
) -> None:
    """Posts are 3 arc-seconds apart: the aircraft is 749.8 rows south and 337.5 columns east of the corner."""
    gap = "the stored terrain has a gap below the aircraft, at 44.375 -71.719: name a file that fills it"
    for row, said in ((749, True), (700, False)):
        height_m = white_mountains.grid.height_m.copy()
        height_m[row : row + 2, 337:339] = np.nan
        verdict, _ = judge(Terrain(white_mountains.grid.with_heights(height_m), [], ""), honest)
        assert (gap in verdict.reasons) == said
        assert (verdict.verdict == "unavailable") == said


def test_an_aircraft_below_the_stored_terrain_is_never_ok(white_mountains: Terrain, honest: Scan) -> None:
    grid = white_mountains.grid
    feet = Terrain(grid.with_heights(grid.height_m / np.float32(0.3048)), [], "")
    verdict, _ = judge(feet, honest, settings=MonitorSettings(minimum_pairs=2, p_fa=0.1))
    assert verdict.verdict != "ok"
    assert any("below the stored terrain" in reason for reason in verdict.reasons)


def test_beyond_70_degrees_of_latitude_the_monitor_declines(white_mountains: Terrain, honest: Scan) -> None:
    for latitude in (70.01, -70.01):
        reason = refused(white_mountains, honest, flying(latitude_deg=latitude))
        assert reason == "61 radials start beyond 70 degrees of latitude"


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
