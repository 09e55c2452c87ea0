"""Which word of which equipment gives which quantity; coarse and fine words of the position joined within an epoch."""

from math import floor

import numpy as np
import pytest

from decoders.arinc429 import decode, load_definitions
from monitor.aircraft import AXES, SOURCES, Aircraft, status_name
from monitor.track import MISSING, STALE
from tests.decoders.bus import word429

GNSS, IRU, RADIO = 0x0B, 0x04, 0x07
SETS = {GNSS: "gnss_743a", IRU: "iru_704", RADIO: "ra_707"}
MS = 1_000_000
NORMAL_SSM, NO_COMPUTED_DATA_SSM = 3, 1
NO_COMPUTED_DATA = 1
FINE_STEP_DEG = 180 / 2**31


def feed(aircraft: Aircraft, equipment: int, words: list[tuple[int, int]]) -> None:
    """Words as (time in ms, word)."""
    times = np.array([time for time, _ in words], np.int64) * MS
    raw = np.array([word for _, word in words], np.uint32)
    aircraft.feed(equipment, times, raw, decode(raw, load_definitions(SETS[equipment])))


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


def test_labels_of_other_equipment_give_nothing() -> None:
    """Label 314 is a true heading on an inertial bus, and something else elsewhere."""
    aircraft = Aircraft()
    words = [(t, word429(0o314, {14: (0x1000, 16)}, ssm=NORMAL_SSM)) for t in (0, 40)]
    raw = np.array([word for _, word in words], np.uint32)
    aircraft.feed(0x06, np.array([0, 40 * MS]), raw, decode(raw, load_definitions("iru_704")))
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
    assert {axis.equipment for axis in AXES} == {GNSS}
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
