"""Short simulated flights, byte for byte through decoders and monitor, on both terrains and all radar profiles."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import rasterio

from benchmarks.evidence.faults import FAULTS
from benchmarks.flights import Flight, Judged, fly
from gateway.demo import CALIBRATION, SHIFT_EAST_M, shift_terrain
from monitor.calibration import load_calibration
from monitor.terrain import open_terrain
from monitor.verdict import ALERT, OK, UNAVAILABLE
from simulators.scenario import BUILT_IN_TERRAIN, Fault, Radar, Scenario, World, white_mountains
from simulators.scenario import Flight as Plan

WHITE_MOUNTAINS = BUILT_IN_TERRAIN["white_mountains"]
SIERRA = Path(__file__).parent / "data" / "terrain" / "sierra_nevada_1arcsec_wgs84.tif"
SWEEP_S = 61 * 3 / 40  # 61 radials, 3 degrees apart, at 40 degrees a second
P_FA = 1e-3
EVIDENCE = Path(__file__).parents[1] / "docs" / "evidence.md"


def low_pass(radar: Radar | None = None, sweeps: int = 2, faults: tuple[Fault, ...] = ()) -> Scenario:
    """The reference flight of the demo with one radial in six, which is all that the monitor looks at."""
    radar = (radar or Radar()).model_copy(update={"step_deg": 3.0})
    return white_mountains(sweeps * SWEEP_S, seed=77).model_copy(update={"radar": radar, "faults": faults})


def verdicts(judged: list[Judged]) -> set[str]:
    return {scan.verdict.verdict for scan in judged}


def test_shifted_terrain_has_its_heights_where_they_were_moved_to(tmp_path: Path) -> None:
    true, moved = (
        open_terrain(path)
        for path in (
            WHITE_MOUNTAINS,
            shift_terrain(WHITE_MOUNTAINS, tmp_path / "moved.tif", east_m=500.0, north_m=-200.0, up_m=-30.5),
        )
    )
    latitude, longitude = np.array([44.4, 44.5, 44.6]), np.array([-71.6, -71.5, -71.4])
    east_deg = 500 / (111_320 * np.cos(np.radians(44.5)))  # one length for the whole cell, that of its middle
    found = moved.elevation(latitude - 200 / 111_132, longitude + east_deg)
    assert found == pytest.approx(true.elevation(latitude, longitude) - 30.5, abs=2.0)


def test_voids_of_shifted_terrain_stay_voids(tmp_path: Path) -> None:
    holed = tmp_path / "holed.tif"
    with rasterio.open(WHITE_MOUNTAINS) as source:
        heights = source.read()
        heights[0, 600:610, 600:610] = source.nodata
        with rasterio.open(holed, "w", **{**source.profile, "driver": "GTiff"}) as copy:
            copy.write(heights)
    raised = shift_terrain(holed, tmp_path / "raised.tif", up_m=50.0)
    assert np.isnan(open_terrain(raised).grid.height_m).sum() == 100


def test_the_page_of_evidence_has_a_row_for_each_fault_that_is_flown() -> None:
    page = EVIDENCE.read_text()
    assert [fault.name for fault in FAULTS if f"\n| {fault.name.removesuffix(' 0')} | " not in page] == []


def test_a_heading_four_degrees_off_alerts() -> None:
    faults = (Fault(name="heading_offset", heading_deg=4.0),)
    assert ALERT in verdicts(fly(Flight(low_pass(faults=faults), WHITE_MOUNTAINS, P_FA)))


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shift_terrain(WHITE_MOUNTAINS, tmp_path_factory.mktemp("terrain") / "shifted.tif", east_m=SHIFT_EAST_M)


@pytest.mark.parametrize(
    "radar",
    [Radar(), Radar(payload="wxr2100_6bit"), Radar(antenna="rdr4b")],
    ids=["3-bit", "6-bit", "to-and-fro"],
)
def test_true_terrain_is_ok_and_shifted_terrain_alerts_with_every_profile(radar: Radar, shifted: Path) -> None:
    scenario = low_pass(radar)
    assert verdicts(fly(Flight(scenario, WHITE_MOUNTAINS, P_FA))) == {OK}
    assert ALERT in verdicts(fly(Flight(scenario, shifted, P_FA)))


def test_the_demo_calibration_is_named_in_every_verdict_and_holds_for_its_radar() -> None:
    judged = fly(Flight(low_pass(), WHITE_MOUNTAINS, P_FA, load_calibration(CALIBRATION)))
    assert verdicts(judged) == {OK}
    assert {scan.verdict.calibration for scan in judged} == {"demo-white-mountains"}


def test_an_alert_names_the_shift_that_explains_it_and_no_other_verdict_names_one(tmp_path: Path) -> None:
    """Half a kilometre to the east and 300 m south, to within the finest step and a post of the terrain."""
    moved = shift_terrain(WHITE_MOUNTAINS, tmp_path / "moved.tif", east_m=500.0, north_m=-300.0)
    judged = fly(Flight(low_pass(), moved, P_FA, load_calibration(CALIBRATION)))
    assert verdicts(judged) == {ALERT}
    for scan in judged:
        assert scan.verdict.offset_east_m == pytest.approx(500, abs=100)
        assert scan.verdict.offset_north_m == pytest.approx(-300, abs=100)
        assert (scan.verdict.offset_confidence or 0) > 0.9
    (fine,) = fly(Flight(low_pass(sweeps=1), WHITE_MOUNTAINS, P_FA, load_calibration(CALIBRATION)))
    assert fine.verdict.offset_east_m is None


def test_shadows_without_a_partner_alert_where_the_terrain_is_another(shifted: Path) -> None:
    (scan,) = fly(Flight(low_pass(sweeps=1), shifted, P_FA, load_calibration(CALIBRATION)))
    found = scan.verdict
    assert found.unmatched_dem is not None
    assert found.unmatched_dem_limit is not None
    assert found.unmatched_dem > found.unmatched_dem_limit
    assert "the unmatched share of terrain shadows" in " ".join(found.reasons)


def test_a_radar_of_another_gain_than_calibrated_gives_no_verdict() -> None:
    judged = fly(Flight(low_pass(Radar(snr_db=6.0)), WHITE_MOUNTAINS, P_FA, load_calibration(CALIBRATION)))
    assert verdicts(judged) == {UNAVAILABLE}
    assert all("check the radar's gain" in " ".join(scan.verdict.reasons) for scan in judged)


def test_a_calibration_for_another_radar_makes_the_verdict_unavailable() -> None:
    scenario = low_pass(Radar(payload="wxr2100_6bit"), sweeps=1)
    (scan,) = fly(Flight(scenario, WHITE_MOUNTAINS, P_FA, load_calibration(CALIBRATION)))
    assert scan.verdict.verdict == UNAVAILABLE
    assert "256" in scan.verdict.reasons[0]


@pytest.mark.parametrize(
    ("payload", "profile", "bits"), [("arinc708", "wxr2100_6bit", 3), ("wxr2100_6bit", "arinc708", 6)]
)
def test_a_radar_read_with_the_wrong_profile_gives_no_verdict_and_says_what_its_bins_look_like(
    payload: Literal["arinc708", "wxr2100_6bit"], profile: str, bits: int
) -> None:
    scenario = low_pass(Radar(payload=payload), sweeps=1)
    (scan,) = fly(Flight(scenario, WHITE_MOUNTAINS, P_FA, radar_profile=profile))
    assert scan.verdict.verdict == UNAVAILABLE
    assert f"look like {bits} bits each: check radar_profile" in scan.verdict.reasons[0]


def test_a_second_terrain_gives_verdicts_on_the_radials_that_stay_on_it() -> None:
    plan = Plan(
        latitude_deg=37.39902, longitude_deg=-119.40492, height_m=2411.0, heading_deg=52.2, duration_s=2 * SWEEP_S
    )
    world = World(terrain=str(SIERRA), incomplete=True)
    scenario = Scenario(flight=plan, world=world, radar=Radar(tilt_deg=-1.0, step_deg=3.0), seed=78)
    judged = fly(Flight(scenario, SIERRA, P_FA))
    assert verdicts(judged) == {OK}
    assert all("leave the terrain" in " ".join(scan.verdict.reasons) for scan in judged)


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("gnss_no_computed_data", "NO_COMPUTED_DATA"),
        ("gnss_acquisition", "the GNSS receiver's mode is acquisition"),
        ("gnss_satellite_failure", "the GNSS receiver has detected a satellite failure"),
        ("inertial_failure_warning", "FAILURE_WARNING"),
    ],
)
def test_a_failing_source_makes_the_verdict_unavailable_and_says_which_status(fault: str, why: str) -> None:
    faults = (Fault.model_validate({"name": fault}),)
    judged = fly(Flight(low_pass(sweeps=1, faults=faults), WHITE_MOUNTAINS, P_FA))
    assert verdicts(judged) == {UNAVAILABLE}
    assert why in " ".join(judged[0].verdict.reasons)


def test_a_stuck_scanner_never_gives_a_verdict_of_ok() -> None:
    faults = (Fault(name="scanner_stuck"),)
    judged = fly(Flight(low_pass(sweeps=3, faults=faults), WHITE_MOUNTAINS, P_FA))
    assert verdicts(judged) == {UNAVAILABLE}


def test_a_gnss_position_500_m_off_alerts_like_terrain_500_m_off() -> None:
    faults = (Fault(name="gnss_offset", east_m=500.0),)
    assert ALERT in verdicts(fly(Flight(low_pass(faults=faults), WHITE_MOUNTAINS, P_FA)))
