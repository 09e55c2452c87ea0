"""Short simulated flights, byte for byte through decoders and monitor, on both terrains and all radar profiles."""

from pathlib import Path
from typing import Literal

import pytest

from benchmarks.flights import Flight, Judged, fly
from gateway.demo import CALIBRATION, SHIFT_EAST_M, shift_east
from monitor.calibration import load_calibration
from monitor.integrity import ALERT, OK, UNAVAILABLE
from simulators.scenario import BUILT_IN_TERRAIN, Fault, Radar, Scenario, World, white_mountains
from simulators.scenario import Flight as Plan

WHITE_MOUNTAINS = BUILT_IN_TERRAIN["white_mountains"]
SIERRA = Path(__file__).parent / "data" / "terrain" / "sierra_nevada_1arcsec_wgs84.tif"
SWEEP_S = 61 * 3 / 40  # 61 radials, 3 degrees apart, at 40 degrees a second
P_FA = 1e-3


def low_pass(radar: Radar | None = None, sweeps: int = 2, faults: tuple[Fault, ...] = ()) -> Scenario:
    """The reference flight of the demo with one radial in six, which is all that the monitor looks at."""
    radar = (radar or Radar()).model_copy(update={"step_deg": 3.0})
    return white_mountains(sweeps * SWEEP_S, seed=77).model_copy(update={"radar": radar, "faults": faults})


def verdicts(judged: list[Judged]) -> set[str]:
    return {scan.verdict.verdict for scan in judged}


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shift_east(WHITE_MOUNTAINS, SHIFT_EAST_M, tmp_path_factory.mktemp("terrain") / "shifted.tif")


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
    [("gnss_no_computed_data", "NO_COMPUTED_DATA"), ("inertial_failure_warning", "FAILURE_WARNING")],
)
def test_a_failing_source_makes_the_verdict_unavailable_and_says_which_status(fault: str, why: str) -> None:
    faults = (Fault.model_validate({"name": fault}),)
    judged = fly(Flight(low_pass(sweeps=1, faults=faults), WHITE_MOUNTAINS, P_FA))
    assert verdicts(judged) == {UNAVAILABLE}
    assert why in judged[0].verdict.reasons[0]


def test_a_stuck_scanner_never_gives_a_verdict_of_ok() -> None:
    faults = (Fault(name="scanner_stuck"),)
    judged = fly(Flight(low_pass(sweeps=3, faults=faults), WHITE_MOUNTAINS, P_FA))
    assert verdicts(judged) == {UNAVAILABLE}


def test_a_gnss_position_500_m_off_alerts_like_terrain_500_m_off() -> None:
    faults = (Fault(name="gnss_offset", east_m=500.0),)
    assert ALERT in verdicts(fly(Flight(low_pass(faults=faults), WHITE_MOUNTAINS, P_FA)))
