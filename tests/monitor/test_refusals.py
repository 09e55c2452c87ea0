"""What keeps a scan, or some of its radials, from a verdict: the radar, the state, the position and the terrain."""

from dataclasses import replace

import numpy as np
import pytest
from pyproj import Geod

from decoders.formats import MODES_708
from monitor.aircraft import Aircraft
from monitor.calibration import Limits
from monitor.integrity import Monitor
from monitor.pointing import NEEDED
from monitor.prediction import Beam
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.terrain import Terrain
from monitor.track import Track
from tests.monitor.scanning import ANGLES, CALIBRATED, HERE, MS, NO_COMPUTED_DATA, VOUCHED, flying, judge, moved

FAN_DEG = Beam().azimuth_span * Beam().width_deg


def refused(terrain: Terrain, scan: Scan, aircraft: Aircraft | None = None) -> str:
    """The only reason of a scan that allows no comparison."""
    verdict, comparison = Monitor(terrain, None, CALIBRATED).judge(scan, aircraft or flying())
    assert comparison is None
    assert (verdict.verdict, verdict.n_pairs, verdict.q, verdict.t_bins2) == ("unavailable", 0, None, None)
    (reason,) = verdict.reasons
    return reason


def test_a_radar_that_reports_a_fault_is_refused(white_mountains: Terrain, honest: Scan) -> None:
    assert "faults: bits 1000000" in refused(white_mountains, replace(honest, faults=1 << 6))


def test_no_echo_at_all_is_unavailable_and_never_good(white_mountains: Terrain, honest: Scan) -> None:
    verdict, _ = judge(white_mountains, replace(honest, bins=np.zeros_like(honest.bins)))
    assert (verdict.verdict, verdict.n_pairs, verdict.t_bins2, verdict.mean_bins) == ("unavailable", 0, None, None)
    assert verdict.reasons == ("0 pairs of shadows, 20 needed",)
    assert (verdict.unmatched_radar, verdict.unmatched_dem) == (None, None)


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


def test_a_calibration_for_another_profile_of_as_many_bins_is_refused(white_mountains: Terrain, honest: Scan) -> None:
    """One whose levels are coded otherwise casts other shadows."""
    for_another = CALIBRATED.model_copy(update={"radar_profile": "rdr4000"})
    read = replace(honest, profile="arinc708")
    verdict, comparison = Monitor(white_mountains, None, for_another).judge(read, flying())
    assert (verdict.verdict, comparison) == ("unavailable", None)
    assert verdict.reasons[0].startswith("calibration test radar is for radar profile rdr4000, this one is arinc708: ")
    assert judge(white_mountains, read)


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


def test_a_scan_flown_higher_or_lower_than_the_calibration_s_is_not_ok_but_may_alert(
    white_mountains: Terrain, honest: Scan
) -> None:
    """The antenna is at 761 m, the ground below it at 402.8 m."""
    for lowest, highest, verdict_told in ((300, 400, "ok"), (200, 300, "unavailable"), (400, 500, "unavailable")):
        limits = Limits(lowest=lowest, highest=highest)
        calibration = CALIBRATED.model_copy(update={"height_m": limits})
        verdict, _ = judge(white_mountains, honest, calibration=calibration)
        assert verdict.verdict == verdict_told
        said = f"m above ground, where calibration test radar has {lowest} to {highest} m: calibrate at the heights"
        assert any(said in reason for reason in verdict.reasons) == (verdict_told != "ok")
        wrong, _ = judge(white_mountains, moved(honest, 4), calibration=calibration)
        assert wrong.verdict == "alert"
        assert any(said in reason for reason in wrong.reasons) == (verdict_told != "ok")


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


def test_a_scan_over_a_gap_is_not_ok_though_later_radials_begin_beside_it(
    white_mountains: Terrain, honest: Scan
) -> None:
    """The first half of the sweep begins over the gap: the other half has pairs enough for a verdict."""
    grid, aircraft = white_mountains.grid, flying()
    height_m = grid.height_m.copy()
    height_m[739:741, 337:339] = np.nan  # ten rows to the north
    times = 100 * MS + MS * np.arange(len(honest.time_ns))
    moved = times[len(times) // 2]
    track = Track(aircraft.tracks["latitude_deg"].quantity)
    at = np.array([times[0] - 1, moved - 2, moved - 1, times[-1] + 1])
    latitude_deg = HERE["latitude_deg"] + np.array([10, 10, 0, 0]) * grid.row_deg
    track.append(at, latitude_deg, np.zeros(4, np.uint8))
    aircraft.tracks["latitude_deg"] = track
    settings = MonitorSettings(minimum_pairs=4, p_fa=0.05)
    verdict, _ = judge(
        Terrain(grid.with_heights(height_m), [], ""), replace(honest, time_ns=times), aircraft, settings=settings
    )
    assert verdict.n_pairs >= 4
    assert verdict.verdict != "ok"
    assert "gap below the aircraft" in verdict.reasons[0]


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
