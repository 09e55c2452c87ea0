"""What the buses say against what is true, label by label."""

import numpy as np
import pytest
from numpy.typing import NDArray

from simulators import scenario
from simulators.instruments import Channel, channels
from simulators.traffic import Simulation, prepare
from tests.simulators.packets import signed, ssm_of

Floats = NDArray[np.float64]
SECONDS = np.arange(0.0, 10.0)


def fly(**changes: object) -> tuple[Simulation, dict[int, Channel]]:
    settings = scenario.white_mountains(duration_s=10.0).model_copy(update=changes)
    simulation = prepare(settings)
    buses = channels(settings, simulation.trajectory, simulation.ground)
    return simulation, {bus.number: bus for bus in buses}


def position(bus: Channel, coarse: int, fine: int) -> Floats:
    pairs = zip(bus.words(coarse, SECONDS).tolist(), bus.words(fine, SECONDS).tolist(), strict=True)
    return np.array([(signed(high, 9) * 2048 + (low >> 17 & 0x7FF)) * 180 / 2**31 for high, low in pairs])


def values(bus: Channel, label: int, first_bit: int, lsb: float) -> Floats:
    return np.array([signed(word, first_bit) * lsb for word in bus.words(label, SECONDS).tolist()])


def test_gnss_position_is_the_truth_within_its_errors() -> None:
    simulation, buses = fly()
    truth = simulation.trajectory.at(SECONDS)
    assert position(buses[2], 0o110, 0o120) == pytest.approx(truth.latitude_deg, abs=1e-4)
    assert position(buses[2], 0o111, 0o121) == pytest.approx(truth.longitude_deg, abs=1e-4)
    assert values(buses[2], 0o076, 9, 0.125 * 0.3048) == pytest.approx(truth.height_m, abs=25)


def test_gnss_biases_have_their_standard_deviation_over_many_flights() -> None:
    def error(seed: int) -> float:
        simulation, buses = fly(seed=seed, radar=scenario.Radar(range_nm=5), world=scenario.World(spacing_m=500))
        return float(np.mean(position(buses[2], 0o110, 0o120) - simulation.trajectory.at(SECONDS).latitude_deg))

    errors = [error(seed) for seed in range(40)]
    assert np.std(errors) == pytest.approx(20e-6, rel=0.35)
    assert abs(np.mean(errors)) < 12e-6


def test_inertial_words_are_the_truth_within_their_errors() -> None:
    simulation, buses = fly()
    truth = simulation.trajectory.at(SECONDS)
    assert values(buses[1], 0o324, 15, 180 / 2**14) == pytest.approx(truth.pitch_deg, abs=0.06)
    assert values(buses[1], 0o325, 15, 180 / 2**14) == pytest.approx(truth.roll_deg, abs=0.06)
    heading = values(buses[1], 0o314, 14, 180 / 2**15)
    assert (heading - truth.heading_deg + 180) % 360 - 180 == pytest.approx(np.zeros(10), abs=0.06)
    assert values(buses[1], 0o312, 14, 0.125) == pytest.approx(truth.ground_speed_mps * 3600 / 1852, abs=0.07)
    assert values(buses[1], 0o361, 9, 0.125 * 0.3048) == pytest.approx(truth.height_m, abs=50)
    assert values(buses[1], 0o310, 9, 180 / 2**20) == pytest.approx(truth.latitude_deg, abs=3e-4)


def test_the_inertial_position_drifts_away_from_the_true_one() -> None:
    simulation, buses = fly(errors=scenario.Errors(inertial_drift_mps=50.0))
    error = values(buses[1], 0o310, 9, 180 / 2**20) - simulation.trajectory.at(SECONDS).latitude_deg
    assert abs(error[-1] - error[0]) > 1e-4
    assert np.diff(error) == pytest.approx(np.full(9, (error[-1] - error[0]) / 9), abs=2e-4)


def test_radio_altitude_is_height_above_the_ground_and_nothing_is_computed_above_2500_feet() -> None:
    simulation, buses = fly()
    truth = simulation.trajectory.at(SECONDS)
    ground = simulation.ground.elevation(*simulation.ground.locate(truth.latitude_deg, truth.longitude_deg))
    assert values(buses[3], 0o164, 13, 0.125 * 0.3048) == pytest.approx(truth.height_m - ground, abs=2.5)
    high = simulation.scenario.flight.model_copy(update={"height_m": 3000.0})
    _, buses = fly(flight=high)
    assert {ssm_of(word) for word in buses[3].words(0o164, SECONDS).tolist()} == {1}


def test_time_words_tell_the_epoch_plus_the_time_of_flight() -> None:
    _, buses = fly(gnss_interval_s=0.2)
    at = np.array([7.4])
    second = int(buses[2].words(0o150, at)[0]) >> 11 & 0x3F
    fraction = (int(buses[2].words(0o140, at)[0]) >> 8 & 0xFFFFF) / 2**20
    assert second + fraction == pytest.approx(7.4, abs=1e-6)
    assert ssm_of(int(buses[2].words(0o150, at)[0])) == 3
    assert ssm_of(int(buses[2].words(0o260, at)[0])) == 0
    assert ssm_of(int(buses[2].words(0o273, at)[0])) == 0


@pytest.mark.parametrize(
    ("name", "channel", "labels", "ssm"),
    [
        ("gnss_no_computed_data", 2, (0o110, 0o120, 0o111, 0o121, 0o076, 0o112, 0o103), 1),
        ("inertial_failure_warning", 1, (0o310, 0o314, 0o325), 0),
        ("radio_altitude_no_computed_data", 3, (0o164,), 1),
    ],
)
def test_a_status_fault_marks_its_labels_during_its_window_only(
    name: str, channel: int, labels: tuple[int, ...], ssm: int
) -> None:
    _, buses = fly(faults=(scenario.Fault.model_validate({"name": name, "start_s": 3, "stop_s": 6}),))
    for label in labels:
        statuses = [ssm_of(word) for word in buses[channel].words(label, SECONDS).tolist()]
        assert statuses == [3] * 3 + [ssm] * 3 + [3] * 4


def test_the_clock_and_the_status_word_go_on_while_the_position_is_lost() -> None:
    _, buses = fly(faults=(scenario.Fault(name="gnss_no_computed_data"),))
    assert ssm_of(int(buses[2].words(0o150, SECONDS)[0])) == 3
    assert ssm_of(int(buses[2].words(0o110, SECONDS)[0])) == 1


def test_a_position_offset_moves_the_gnss_by_its_metres_and_leaves_the_status_normal() -> None:
    fault = scenario.Fault(name="gnss_offset", start_s=5, north_m=500, east_m=-300, up_m=40)
    (_, healthy), (_, shifted) = fly(), fly(faults=(fault,))
    north = (position(shifted[2], 0o110, 0o120) - position(healthy[2], 0o110, 0o120)) * 111_111
    east = (
        (position(shifted[2], 0o111, 0o121) - position(healthy[2], 0o111, 0o121)) * 111_300 * np.cos(np.radians(44.37))
    )
    up = values(shifted[2], 0o076, 9, 0.125 * 0.3048) - values(healthy[2], 0o076, 9, 0.125 * 0.3048)
    assert north == pytest.approx([0] * 5 + [500] * 5, abs=2)
    assert east == pytest.approx([0] * 5 + [-300] * 5, abs=2)
    assert up == pytest.approx([0] * 5 + [40] * 5, abs=0.1)
    assert {ssm_of(word) for word in shifted[2].words(0o110, SECONDS).tolist()} == {3}


def test_a_heading_offset_turns_the_inertial_heading_by_its_degrees_and_nothing_else() -> None:
    fault = scenario.Fault(name="heading_offset", start_s=5, heading_deg=2)
    (_, healthy), (_, turned) = fly(), fly(faults=(fault,))
    heading = values(turned[1], 0o314, 14, 180 / 2**15) - values(healthy[1], 0o314, 14, 180 / 2**15)
    assert heading == pytest.approx([0] * 5 + [2] * 5, abs=0.01)
    assert turned[1].words(0o324, SECONDS).tolist() == healthy[1].words(0o324, SECONDS).tolist()


def test_below_seven_knots_the_track_is_not_computed() -> None:
    slow = scenario.white_mountains(10.0).flight.model_copy(update={"ground_speed_mps": 3.0})
    _, buses = fly(flight=slow)
    assert {ssm_of(word) for word in buses[2].words(0o103, SECONDS).tolist()} == {1}
    assert {ssm_of(word) for word in buses[2].words(0o112, SECONDS).tolist()} == {3}


@pytest.mark.parametrize(
    ("name", "label", "bit"), [("gnss_satellite_failure", 0o130, 11), ("gnss_acquisition", 0o273, 26)]
)
def test_a_bit_fault_turns_its_bit_during_its_window_and_keeps_the_parity_odd(name: str, label: int, bit: int) -> None:
    fault = scenario.Fault.model_validate({"name": name, "start_s": 3, "stop_s": 6})
    (_, healthy), (_, faulty) = fly(), fly(faults=(fault,))
    sent, turned = healthy[2].words(label, SECONDS), faulty[2].words(label, SECONDS)
    assert (sent ^ turned).tolist() == [0] * 3 + [1 << bit - 1 | 1 << 31] * 3 + [0] * 4


def test_every_box_names_itself_once_a_second() -> None:
    _, buses = fly()
    for channel, equipment in ((1, 0x004), (2, 0x00B), (3, 0x007)):
        assert buses[channel].intervals_s[0o377] == 1.0
        assert {word >> 10 & 0xFFF for word in buses[channel].words(0o377, SECONDS).tolist()} == {equipment}
