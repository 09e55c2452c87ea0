"""The radar's echo of what its panel asks: when it is compared, and what is told how often."""

import math
from typing import Any

import numpy as np
import pytest

from decoders.arinc708 import Radials, unpack
from decoders.control708 import Command
from monitor.control_echo import ControlEcho, Finding
from simulators import arinc708

S = 1_000_000_000
ASKED = Command(False, False, False, True, 2, -2.0, math.nan, 20.0)
ANTI_CLUTTER, SECTOR_SCAN = 0b00100, 0b01000  # header bits 15 and 16


def radial(**changes: Any) -> Radials:
    fields: dict[str, Any] = {"scan_angle_deg": 0.0, "tilt_deg": -2.0, "range_nm": 20.0, "mode": 2}
    word = arinc708.encode(np.zeros(512), **fields | changes)
    return unpack(np.frombuffer(word, np.uint8)[None])


def echo(command: Command = ASKED, delay_s: float = 1.0) -> ControlEcho:
    made = ControlEcho(delay_s)
    made.feed_command(0, command)
    return made


def test_a_radar_that_does_as_asked_is_not_worth_a_word() -> None:
    assert echo().feed_radial(2 * S, radial()) is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"mode": 1}, "mode: panel 2, radar 1"),
        ({"tilt_deg": -1.75}, "tilt_deg: panel -2, radar -1.75"),
        ({"gain_db": -3.0}, "gain_db: panel calibrated, radar -3"),
        ({"gain_db": 0.0}, "gain_db: panel calibrated, radar 0"),
        ({"range_nm": 320.0}, "range_nm: panel 20, radar 320"),
        ({"stabilised": False}, "stabilised: panel on, radar off"),
        ({"annunciations": SECTOR_SCAN}, "sector_scan: panel off, radar on"),
        ({"annunciations": ANTI_CLUTTER}, "anti_clutter: panel off, radar on"),
        ({"mode": 1, "range_nm": 40.0}, "mode: panel 2, radar 1; range_nm: panel 20, radar 40"),
    ],
)
def test_each_setting_that_differs_is_named_with_both_values(changes: dict[str, Any], reason: str) -> None:
    assert echo().feed_radial(2 * S, radial(**changes)) == Finding("ECHO_MISMATCH", reason)


def test_what_the_panel_has_not_said_is_not_compared() -> None:
    assert echo(Command(mode=2)).feed_radial(2 * S, radial(tilt_deg=5.0, range_nm=80.0)) is None
    assert ControlEcho().feed_radial(0, radial(mode=7)) is None


def test_either_control_word_may_ask_for_anti_clutter() -> None:
    for command in (ASKED._replace(anti_clutter=True), ASKED._replace(anti_clutter_2=True)):
        assert echo(command).feed_radial(2 * S, radial(annunciations=ANTI_CLUTTER)) is None


def test_a_range_that_the_header_cannot_carry_is_not_compared() -> None:
    assert echo(ASKED._replace(range_nm=0.5)).feed_radial(2 * S, radial()) is None


@pytest.mark.parametrize("delay_s", [0.0, 1.0, 2.5])
def test_a_radar_has_the_delay_to_follow_a_change(delay_s: float) -> None:
    made = echo(delay_s=delay_s)
    assert made.feed_radial(round(delay_s * S) - 1, radial(mode=1)) is None
    assert made.feed_radial(round(delay_s * S), radial(mode=1)) is not None


def test_the_same_command_again_does_not_begin_the_delay_anew() -> None:
    made = echo()
    for tenth in range(1, 10):
        made.feed_command(tenth * S // 10, ASKED)
    assert made.feed_radial(S, radial(mode=1)) is not None


def test_a_mismatch_and_its_end_are_told_once_per_change_and_every_radial_is_counted() -> None:
    made = echo()
    told = []
    for k in range(40):
        made.feed_command(2 * S + k, ASKED)
        told.append(made.feed_radial(2 * S + k, radial(mode=1 if k // 10 % 2 == 0 else 2)))
    assert [(k, finding.state) for k, finding in enumerate(told) if finding] == [
        (0, "ECHO_MISMATCH"),
        (10, "ECHO_AGREES"),
    ]
    assert made.unlike == 20
    made.feed_command(3 * S, ASKED._replace(mode=1))
    again = made.feed_radial(4 * S, radial(mode=3))
    assert again == Finding("ECHO_MISMATCH", "mode: panel 1, radar 3")


def test_a_radar_that_departs_from_an_old_command_is_told() -> None:
    made = echo()
    assert made.feed_radial(2 * S, radial()) is None
    assert made.feed_radial(3 * S, radial(tilt_deg=0.0)) is not None


def test_nothing_is_known_of_a_panel_that_is_silent_or_forgotten() -> None:
    assert echo().feed_radial(5 * S + 1, radial(mode=1)) is None
    made = echo()
    made.forget()
    assert made.feed_radial(2 * S, radial(mode=1)) is None
