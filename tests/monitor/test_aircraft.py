"""Which word of which equipment gives which quantity; coarse and fine words of the position joined within an epoch."""

from math import floor

import numpy as np
import pytest

from decoders.arinc429 import decode, load_definitions
from monitor.aircraft import Aircraft, status_name
from monitor.geoid import undulation_m
from monitor.quantities import AXES, LATITUDE, LONGITUDE, SOURCES
from monitor.track import MISSING, STALE
from tests.decoders.bus import word429

GNSS, IRU, RADIO, AIR_DATA, HYBRID, AHRS = 0x0B, 0x04, 0x07, 0x06, 0x38, 0x05
SETS = {
    GNSS: "gnss_743a", IRU: "iru_704", RADIO: "ra_707", AIR_DATA: "adc_706", HYBRID: "adiru_738", AHRS: "ahrs_705",
}  # fmt: skip
MS = 1_000_000
NORMAL_SSM, NO_COMPUTED_DATA_SSM = 3, 1
NO_COMPUTED_DATA, BAD_PARITY = 1, 4
FINE_STEP_DEG = 180 / 2**31


def feed(aircraft: Aircraft, equipment: int, words: list[tuple[int, int]]) -> None:
    """Words as (time in ms, word)."""
    times = np.array([time for time, _ in words], np.int64) * MS
    raw = np.array([word for _, word in words], np.uint32)
    definitions = load_definitions(SETS[equipment])
    aircraft.feed(definitions, times, raw, decode(raw, definitions))


def coarse_and_fine(label: int, degrees: float, coarse_ssm: int = 3, fine_ssm: int = 3) -> tuple[int, int]:
    """An angle in 2^-31 half turns, rounded down: the upper 21 bits in the coarse word, the rest in the fine one."""
    steps = floor(degrees / FINE_STEP_DEG)
    coarse = word429(label, {9: (steps >> 11, 21)}, ssm=coarse_ssm)
    return coarse, word429(label + 0o10, {18: (steps & 0x7FF, 11)}, ssm=fine_ssm)


def latitudes(aircraft: Aircraft, *times_ms: int) -> tuple[list[float], list[int]]:
    found = aircraft.tracks["latitude_deg"].at(np.array(times_ms, np.int64) * MS)
    return found.value.tolist(), found.status.tolist()


@pytest.mark.parametrize("fine_first", [False, True])
@pytest.mark.parametrize("latitude", [44.37514, -44.37514, 0.0001, -0.0001])
@pytest.mark.parametrize("longitude", [-71.71874, 71.71874, -179.99999])
def test_a_position_is_joined_to_its_last_bit_in_every_quarter_of_the_globe(
    latitude: float, longitude: float, fine_first: bool
) -> None:
    aircraft = Aircraft()
    order = -1 if fine_first else 1
    for time in (0, 200):
        for label, degrees in ((0o110, latitude), (0o111, longitude)):
            words = coarse_and_fine(label, degrees)[::order]
            feed(aircraft, GNSS, [(time, words[0]), (time + 2, words[1])])
    for name, degrees in (("latitude_deg", latitude), ("longitude_deg", longitude)):
        found = aircraft.tracks[name].at(np.array([100 * MS]))
        assert found.status.tolist() == [0]
        assert 0 <= degrees - found.value[0] < 1.01 * FINE_STEP_DEG


def test_a_joined_position_is_worth_its_time_between_epochs() -> None:
    aircraft = Aircraft()
    for time, degrees in ((0, 44.0), (200, 44.5)):
        coarse, fine = coarse_and_fine(0o110, degrees)
        feed(aircraft, GNSS, [(time, coarse), (time + 5, fine)])
    values, status = latitudes(aircraft, 50)
    assert status == [0]
    assert values == pytest.approx([44.125], abs=2 * FINE_STEP_DEG)


def test_halves_of_two_epochs_are_never_joined() -> None:
    """The fine word of the second epoch is lost: what comes next must not take an old half."""
    aircraft = Aircraft()
    for time, degrees, fine_too in ((0, 44.0, True), (200, 44.1, False), (400, 44.2, True)):
        coarse, fine = coarse_and_fine(0o110, degrees)
        feed(aircraft, GNSS, [(time, coarse)])
        if fine_too:
            feed(aircraft, GNSS, [(time + 2, fine)])
    values, status = latitudes(aircraft, 0, 200, 400)
    assert status == [0, 0, 0]
    np.testing.assert_allclose(values, [44.0, 44.1, 44.2], atol=1e-6)  # 200 ms lies halfway between the joined ones
    coarse, fine = coarse_and_fine(0o110, 50.0)
    feed(aircraft, GNSS, [(600, coarse), (701, fine)])
    newest = aircraft.tracks["latitude_deg"].newest
    assert newest is not None
    assert newest[0] == 400 * MS


@pytest.mark.parametrize(("coarse_ssm", "fine_ssm"), [(1, 3), (3, 1)])
def test_no_computed_data_on_either_half_is_a_hole(coarse_ssm: int, fine_ssm: int) -> None:
    aircraft = Aircraft()
    for time, ssms in ((0, (3, 3)), (200, (coarse_ssm, fine_ssm)), (400, (3, 3)), (600, (3, 3))):
        coarse, fine = coarse_and_fine(0o110, 45.0, *ssms)
        feed(aircraft, GNSS, [(time, coarse), (time + 2, fine)])
    assert latitudes(aircraft, 100, 300, 500) == ([0, 0, 45.0], [NO_COMPUTED_DATA, NO_COMPUTED_DATA, 0])


@pytest.mark.parametrize(("half", "ssm", "status"), [(0, 1, NO_COMPUTED_DATA), (1, 1, NO_COMPUTED_DATA), (0, 0, 3)])
def test_an_invalid_half_is_a_hole_at_its_time_though_its_other_half_is_lost(half: int, ssm: int, status: int) -> None:
    """From 1000 ms on one epoch, or every one, has an invalid half alone."""
    for ends in (1001, 3000):
        aircraft = Aircraft()
        for time in range(0, 3000, 200):
            words = coarse_and_fine(0o110, 45.0, ssm if half == 0 else 3, ssm if half == 1 else 3)
            good = coarse_and_fine(0o110, 45.0)
            invalid = 1000 <= time < ends
            feed(aircraft, GNSS, [(time, words[half])] if invalid else [(time, good[0]), (time + 2, good[1])])
        assert latitudes(aircraft, 700, 900, 1100)[1] == [0, status, status]
        assert latitudes(aircraft, 2900)[1] == [status if ends == 3000 else 0]


def pitch(sdi: int, steps: int, **damage: bool) -> int:
    return word429(0o324, {9: (sdi, 2), 15: (steps, 15)}, ssm=NORMAL_SSM, **damage)


def test_of_two_sources_on_one_bus_the_first_is_used_until_it_falls_silent() -> None:
    """SDI 1 and 2 send a pitch 0.36 ms apart; words to all count for either."""
    aircraft, step = Aircraft(), 180 / 2**14
    for time in range(0, 400, 20):
        feed(aircraft, IRU, [(time, pitch(1, 182)), (time + 1, pitch(2, 191)), (time + 2, pitch(0, 182))])
    found = aircraft.tracks["pitch_deg"].at(np.array([381, 390, 500, 630]) * MS)
    assert (found.status.tolist(), found.value.tolist()) == ([0] * 4, [pytest.approx(182 * step)] * 4)
    ((about, doubt),) = aircraft.doubts().items()
    assert about == "SDI 1 of equipment 04"
    assert "words of SDI 2 are left out" in doubt
    for time in (2800, 2890, 2910):  # 2.5 s after the last of SDI 1
        feed(aircraft, IRU, [(time, pitch(2, 191))])
    assert aircraft.tracks["pitch_deg"].at(np.array([2900 * MS])).value.tolist() == [pytest.approx(191 * step)]
    feed(aircraft, IRU, [(2920, pitch(1, 182)), (2930, pitch(2, 191))])
    assert aircraft.tracks["pitch_deg"].at(np.array([2920 * MS])).value.tolist() == [pytest.approx(191 * step)]
    assert [*aircraft.doubts()] == ["SDI 1 of equipment 04", "SDI 2 of equipment 04"]


def test_which_source_is_left_out_for_which_does_not_depend_on_the_blocks() -> None:
    sent = [(time, pitch(1, 182)) for time in range(0, 400, 20)] + [
        (time, pitch(2, 191)) for time in range(1, 4000, 20)
    ]
    sent.sort()
    whole, cut = Aircraft(), Aircraft()
    feed(whole, IRU, sent)
    for word in sent:
        feed(cut, IRU, [word])
    ((about, doubt),) = whole.doubts().items()
    assert (about, doubt.partition(",")[0]) == ("SDI 1 of equipment 04", "words of SDI 2 are left out")
    assert cut.doubts() == whole.doubts()
    assert cut.tracks["pitch_deg"].newest == whole.tracks["pitch_deg"].newest == (3981 * MS, 191 * 180 / 2**14, 0)


def test_a_damaged_word_chooses_no_source_and_is_a_hole() -> None:
    aircraft = Aircraft()
    feed(aircraft, IRU, [(0, pitch(2, 191, odd=False)), (20, pitch(1, 182)), (40, pitch(3, 182, odd=False))])
    assert aircraft.doubts() == {}
    assert aircraft.tracks["pitch_deg"].at(np.array([40 * MS])).status.tolist() == [BAD_PARITY]


def test_words_without_a_source_are_of_every_source() -> None:
    """Bits 9 and 10 of a latitude are its last digits."""
    aircraft = Aircraft()
    feed(aircraft, IRU, [(t, word429(0o310, {9: (2**18 + t, 21)}, ssm=NORMAL_SSM)) for t in range(4)])
    assert aircraft.doubts() == {}
    assert aircraft.tracks["inertial_latitude_deg"].newest == (3 * MS, (2**18 + 3) * 180 / 2**20, 0)


def test_labels_of_other_equipment_give_nothing() -> None:
    """Label 314 is a true heading on an inertial bus, and something else elsewhere."""
    aircraft = Aircraft()
    words = [(t, word429(0o314, {14: (0x1000, 16)}, ssm=NORMAL_SSM)) for t in (0, 40)]
    feed(aircraft, AIR_DATA, words)
    assert all(track.newest is None for track in aircraft.tracks.values())
    feed(aircraft, IRU, words)
    assert [name for name, track in aircraft.tracks.items() if track.newest] == ["heading_deg"]


@pytest.mark.parametrize(
    ("equipment", "label", "fields", "name", "value"),
    [  # bits, first and width, from the label tables: two's complement binary, the sign in bit 29
        (GNSS, 0o076, {9: (8 * 2500, 21)}, "height_m", 2500 * 0.3048),
        (IRU, 0o312, {14: (2**15 // 4096 * 175, 16)}, "ground_speed_m_s", 175 * 1852 / 3600),
        (IRU, 0o314, {14: (2**15 // 4 * 3, 16)}, "heading_deg", 135.0),
        (IRU, 0o324, {14: (2**16 - 1820, 16)}, "pitch_deg", -1820 * 180 / 2**15),
        (IRU, 0o325, {14: (2**15 // 8, 16)}, "roll_deg", 22.5),
        (IRU, 0o321, {18: (2**12 - 64, 12)}, "drift_deg", -64 * 180 / 2**11),
        (IRU, 0o365, {14: (2**16 - 600, 16)}, "up_velocity_m_s", -10 * 0.3048),
        (IRU, 0o366, {14: (8 * 36, 16)}, "north_velocity_m_s", 36 * 1852 / 3600),
        (AHRS, 0o365, {14: (600, 16)}, "up_velocity_m_s", 10 * 0.3048),
        (HYBRID, 0o324, {15: (2**15 // 8, 15)}, "pitch_deg", 45.0),
        (HYBRID, 0o261, {9: (8 * 1000, 21)}, "hybrid_height_m", 304.8),
        (AIR_DATA, 0o203, {12: (5000, 18)}, "pressure_altitude_m", 1524.0),
        (AIR_DATA, 0o210, {14: (16 * 90, 16)}, "true_airspeed_m_s", 46.3),
        (GNSS, 0o130, {12: (2**13, 17)}, "horizontal_integrity_limit_m", 1852.0),
        (GNSS, 0o247, {11: (2**14, 18)}, "horizontal_figure_of_merit_m", 1852.0),
        (GNSS, 0o370, {9: (8 * 100, 21)}, "ellipsoid_height_m", 30.48),
        (RADIO, 0o164, {13: (8 * 1000, 17)}, "radio_height_m", 304.8),
    ],
)
def test_each_label_gives_its_quantity_in_the_monitor_s_unit(
    equipment: int, label: int, fields: dict[int, tuple[int, int]], name: str, value: float
) -> None:
    aircraft = Aircraft()
    feed(aircraft, equipment, [(t, word429(label, fields, ssm=NORMAL_SSM)) for t in (0, 10)])
    found = aircraft.tracks[name].at(np.array([5 * MS]))
    assert found.status.tolist() == [0]
    assert found.value[0] == pytest.approx(value, rel=1e-12)


def test_inertial_position_never_stands_in_for_the_satellites() -> None:
    assert {source.quantity.name for source in SOURCES if source.label in (0o310, 0o311, 0o361)} == {
        "inertial_latitude_deg",
        "inertial_longitude_deg",
        "inertial_height_m",
    }
    assert {axis.equipment for axis in AXES if axis.quantity in (LATITUDE, LONGITUDE)} == {(GNSS,)}
    aircraft = Aircraft()
    feed(aircraft, IRU, [(t, word429(0o310, {9: (2**18, 21)}, ssm=NORMAL_SSM)) for t in (0, 100)])
    assert aircraft.tracks["inertial_latitude_deg"].newest == (100 * MS, 45.0, 0)
    assert latitudes(aircraft, 50) == ([0.0], [MISSING])


def test_an_invalid_word_marks_its_quantity_with_the_status_of_the_bus() -> None:
    aircraft = Aircraft()
    feed(aircraft, IRU, [(t, word429(0o325, {14: (0, 16)}, ssm=NO_COMPUTED_DATA_SSM)) for t in (0, 20)])
    assert aircraft.tracks["roll_deg"].at(np.array([10 * MS])).status.tolist() == [NO_COMPUTED_DATA]


def test_a_status_is_named_as_it_stands_in_reasons() -> None:
    names = [status_name(code) for code in (NO_COMPUTED_DATA, 4, STALE, MISSING)]
    assert names == ["NO_COMPUTED_DATA", "BAD_PARITY", "STALE", "MISSING"]


def test_the_same_label_in_metres_or_miles_gives_the_same_quantity() -> None:
    """247 is a figure of merit in metres from a 743, in nautical miles from a 743A."""
    for name, field_, expected in (("gnss_743", {14: (32 * 9, 15)}, 9.0), ("gnss_743a", {11: (2**14, 18)}, 1852.0)):
        aircraft, definitions = Aircraft(), load_definitions(name)
        raw = np.array([word429(0o247, field_, ssm=NORMAL_SSM)], np.uint32)
        aircraft.feed(definitions, np.array([0]), raw, decode(raw, definitions))
        assert aircraft.tracks["horizontal_figure_of_merit_m"].newest == (0, expected, 0)


def test_discrete_bits_hold_until_the_next_word_and_grow_stale() -> None:
    aircraft = Aircraft()
    for time, failure in ((0, 0), (1000, 1)):
        feed(aircraft, GNSS, [(time, word429(0o130, {11: (failure, 1), 12: (800, 17)}, ssm=NORMAL_SSM))])
    found = aircraft.tracks["gnss_satellite_failure"].at(np.array([-1, 0, 999, 1000, 3500, 3501]) * MS)
    assert found.status.tolist() == [MISSING, 0, 0, 0, 0, STALE]
    assert found.value.tolist() == [0, 0, 0, 1, 1, 0]


def test_two_sources_of_one_quantity_are_never_mixed() -> None:
    """An IRU and an ADIRU both send pitch; the second is taken only once the first has been silent long enough."""
    aircraft = Aircraft()
    for time in range(0, 200, 20):
        feed(aircraft, IRU, [(time, word429(0o324, {15: (910, 15)}, ssm=NORMAL_SSM))])
        feed(aircraft, HYBRID, [(time + 7, word429(0o324, {15: (2730, 15)}, ssm=NORMAL_SSM))])
    one, other = 910 * 180 / 2**14, 2730 * 180 / 2**14
    assert aircraft.tracks["pitch_deg"].at(np.array([90 * MS])).value.tolist() == [one]
    for time in (500, 701, 721):  # 500 ms is twice what pitch may be silent
        feed(aircraft, HYBRID, [(time, word429(0o324, {15: (2730, 15)}, ssm=NORMAL_SSM))])
    found = aircraft.tracks["pitch_deg"].at(np.array([90, 710]) * MS)
    assert (found.status.tolist(), found.value[1]) == ([STALE, 0], other)


def test_the_height_can_come_from_the_ellipsoid_and_the_geoid() -> None:
    aircraft = Aircraft(height_source="370")
    for time in (0, 200):
        for label, degrees in ((0o110, 44.37514), (0o111, -71.71874)):
            words = coarse_and_fine(label, degrees)
            feed(aircraft, GNSS, [(time, words[0]), (time + 2, words[1])])
        feed(aircraft, GNSS, [(time + 4, word429(0o370, {9: (8 * 2500, 21)}, ssm=NORMAL_SSM))])
        feed(aircraft, GNSS, [(time + 6, word429(0o076, {9: (8 * 9000, 21)}, ssm=NORMAL_SSM))])
    newest = aircraft.tracks["height_m"].newest
    assert newest is not None
    assert newest[1] == pytest.approx(2500 * 0.3048 - undulation_m(44.37514, -71.71874), abs=1e-3)


def test_a_height_over_the_ellipsoid_without_a_position_is_no_height() -> None:
    aircraft = Aircraft(height_source="370")
    feed(aircraft, GNSS, [(t, word429(0o370, {9: (8 * 2500, 21)}, ssm=NORMAL_SSM)) for t in (0, 200)])
    assert aircraft.tracks["height_m"].at(np.array([100 * MS])).status.tolist() == [NO_COMPUTED_DATA]


def test_a_height_over_the_ellipsoid_is_no_height_once_the_position_is_old() -> None:
    aircraft = Aircraft(height_source="370")
    for label, degrees in ((0o110, 44.37514), (0o111, -71.71874)):
        words = coarse_and_fine(label, degrees)
        feed(aircraft, GNSS, [(0, words[0]), (2, words[1])])
    feed(aircraft, GNSS, [(t, word429(0o370, {9: (8 * 2500, 21)}, ssm=NORMAL_SSM)) for t in (2300, 2500, 2501, 2700)])
    found = aircraft.tracks["height_m"].at(np.array([2400, 2600]) * MS)
    assert found.status.tolist() == [0, STALE]
