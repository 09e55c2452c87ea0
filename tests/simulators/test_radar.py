"""Scan timetable, statistics of speckle and noise, and the reference configuration."""

import numpy as np
import pytest
from scipy import stats

from simulators import antenna, radar, scenario
from simulators.traffic import Simulation, prepare


@pytest.fixture(scope="module")
def reference() -> Simulation:
    return prepare(scenario.white_mountains(duration_s=20.0))


def test_the_one_way_antenna_takes_80_radials_a_second_and_jumps_back() -> None:
    timetable = antenna.scan(scenario.Radar())
    assert len(timetable.radials_between(3.0, 4.0)) == 80
    angles = timetable.angles_deg(np.arange(722))
    assert angles[:361].tolist() == angles[361:].tolist() == np.arange(-90, 90.5, 0.5).tolist()


def test_the_to_and_fro_antenna_takes_190_radials_a_second_and_never_jumps() -> None:
    timetable = antenna.scan(scenario.Radar(antenna="rdr4b"))
    assert len(timetable.radials_between(0.0, 1.0)) == 190
    angles = timetable.angles_deg(np.arange(3000))
    assert np.all(np.abs(np.diff(angles)) == 0.5)
    assert (angles.min(), angles.max()) == (-90, 90)


def test_a_wider_step_keeps_the_scan_rate_in_degrees_a_second() -> None:
    timetable = antenna.scan(scenario.Radar(step_deg=3.0))
    assert timetable.positions == 61
    assert timetable.step_deg / timetable.interval_s == pytest.approx(40.0)


def test_cutting_time_into_spans_neither_loses_nor_repeats_a_radial() -> None:
    timetable = antenna.scan(scenario.Radar(antenna="rdr4b"))
    spans = [timetable.radials_between(k / 10, (k + 1) / 10) for k in range(100)]
    assert np.concatenate(spans).tolist() == list(range(1900))


def test_noise_alone_lights_a_bin_as_often_as_twelve_looks_exceed_four_decibels(reference: Simulation) -> None:
    numbers = np.arange(4000)
    codes = reference.radar.levels(reference.radar.received(np.zeros((4000, 512)), numbers))
    expected = stats.gamma.sf(12 * 10**0.4, 12) * codes.size
    assert abs(np.count_nonzero(codes) - expected) < 4 * np.sqrt(expected)


def test_speckle_has_the_mean_and_spread_of_twelve_looks(reference: Simulation) -> None:
    received = reference.radar.received(np.full((200, 512), 99.0), np.arange(200))
    assert np.mean(received) == pytest.approx(100, rel=0.01)
    assert np.std(received) == pytest.approx(100 / np.sqrt(12), rel=0.02)


def test_levels_begin_four_decibels_over_noise_and_end_at_the_payloads_highest() -> None:
    coarse, fine = (prepare_levels(payload) for payload in ("arinc708", "wxr2100_6bit"))
    assert coarse == [0, 1, 1, 2, 4, 4]
    assert fine == [0, 1, 2, 9, 63, 63]


def prepare_levels(payload: str) -> list[int]:
    settings = scenario.white_mountains(duration_s=1.0)
    settings = settings.model_copy(update={"radar": settings.radar.model_copy(update={"payload": payload})})
    model = prepare(settings).radar
    decibels = np.array([3.9, 4.1, 5.1, 12.1, 66.1, 100.0])
    codes: list[int] = model.levels(10 ** (decibels[None] / 10))[0].tolist()
    return codes


def test_lit_bins_between_five_and_ten_miles_have_a_median_of_18_decibels(reference: Simulation) -> None:
    numbers = np.arange(0, 1600, 8)
    timetable = reference.radar.scan
    ratio = reference.radar.signal_to_noise(
        np.asarray(numbers * timetable.interval_s, np.float64), timetable.angles_deg(numbers)
    )
    lit = reference.radar.levels(reference.radar.received(ratio, numbers)) > 0
    median = np.median(ratio[:, 256:][lit[:, 256:]])
    assert 10 * np.log10(median) == pytest.approx(radar.REFERENCE_SNR_DB, abs=1.0)


def test_radials_do_not_depend_on_how_the_flight_is_cut(reference: Simulation) -> None:
    whole = reference.radar.between(0.0, 1.0).bins
    cut = [reference.radar.between(start, start + 0.1).bins for start in np.arange(10) / 10]
    assert np.array_equal(whole, np.concatenate(cut))


def test_a_stuck_scanner_keeps_its_rate_and_loses_its_azimuth_and_a_silent_radar_sends_nothing() -> None:
    faults = (
        scenario.Fault(name="scanner_stuck", start_s=1, stop_s=2),
        scenario.Fault(name="radar_silent", start_s=2, stop_s=3),
    )
    settings = scenario.white_mountains(duration_s=4.0).model_copy(update={"faults": faults})
    simulation = prepare(settings)
    assert simulation.radar.between(2.2, 2.4).bins.shape == (0, 512)
    radials = simulation.radar.between(0.0, 4.0)
    seconds = np.floor(radials.time_s)
    assert [int(np.sum(seconds == second)) for second in range(4)] == [80, 80, 0, 80]
    assert set(radials.scan_angle_deg[seconds == 1]) == {0.0}


@pytest.mark.parametrize("snr_db", [12.0, 24.0])
def test_a_weaker_radar_lights_fewer_bins(reference: Simulation, snr_db: float) -> None:
    settings = reference.scenario
    other = settings.model_copy(update={"radar": settings.radar.model_copy(update={"snr_db": snr_db})})
    changed = radar.Radar(other, reference.ground, reference.trajectory).between(0.0, 0.5).bins
    usual = reference.radar.between(0.0, 0.5).bins
    assert (np.count_nonzero(changed) < np.count_nonzero(usual)) == (snr_db < 18)
