"""Control words of the radar's panel, their bits laid out here as the public manual lists them."""

import math
from pathlib import Path

import pytest

from decoders.arinc429 import Status
from decoders.arinc429 import decode as decode429
from decoders.control708 import Command, decode, is_panel
from decoders.definitions import DefinitionError, load_definitions
from tests.decoders.bus import word429

PANEL = load_definitions("wxr_panel")
DIVIDED = load_definitions("wxr_panel_divided_range")


def word1(
    *, sector: int = 0, clutter: int = 0, stabilised: int = 0, mode: int = 0, tilt: int = 0, gain: int = 0
) -> int:
    fields = {11: (sector, 1), 12: (clutter, 1), 13: (stabilised, 1), 14: (mode, 3), 17: (tilt, 7), 24: (gain, 6)}
    return word429(0o270, fields)


def word2(code: int, **bits: int) -> int:
    return word429(0o271, {24: (code, 6)} | {int(name[1:]): (bit, 1) for name, bit in bits.items()})


def test_a_whole_command_comes_from_its_words_and_is_unknown_before() -> None:
    first = decode(word1(sector=1, stabilised=1, mode=2, tilt=0b1110011, gain=7), PANEL.labels[0o270])
    assert first == Command(True, False, None, True, 2, -3.25, -7.0, None, None)
    second = decode(word2(0b000101, b12=1), PANEL.labels[0o271], first)
    assert second == first._replace(range_nm=25.0, anti_clutter_2=True)
    third = decode(word429(0o273, {11: (1, 1)}), PANEL.labels[0o273], second)
    assert third == second._replace(vertical_profile=True)


@pytest.mark.parametrize(
    ("bit", "field"),
    [
        ({"sector": 1}, "sector_scan"),
        ({"clutter": 1}, "anti_clutter"),
        ({"stabilised": 1}, "stabilised"),
    ],
)
def test_each_switch_is_its_own_bit(bit: dict[str, int], field: str) -> None:
    plain, switched = (decode(word, PANEL.labels[0o270]) for word in (word1(), word1(**bit)))
    assert switched == plain._replace(**{field: True})


@pytest.mark.parametrize(("code", "tilt_deg"), [(0, 0.0), (1, 0.25), (63, 15.75), (64, -16.0), (127, -0.25)])
def test_tilt_is_twos_complement_in_quarters_of_a_degree(code: int, tilt_deg: float) -> None:
    assert decode(word1(tilt=code), PANEL.labels[0o270]).tilt_deg == tilt_deg


@pytest.mark.parametrize(("code", "gain_db"), [(0, 0.0), (1, -1.0), (62, -62.0), (63, math.nan)])
def test_gain_is_the_code_of_the_radar_s_header(code: int, gain_db: float) -> None:
    assert decode(word1(gain=code), PANEL.labels[0o270]).gain_db == pytest.approx(gain_db, nan_ok=True, abs=0)


@pytest.mark.parametrize("mode", range(8))
def test_every_mode_is_carried(mode: int) -> None:
    assert decode(word1(mode=mode), PANEL.labels[0o270]).mode == mode


@pytest.mark.parametrize(("code", "range_nm"), [(0, 320.0), (1, 5.0), (5, 25.0), (32, 160.0), (63, 315.0)])
def test_range_bits_are_additive_and_zero_is_320(code: int, range_nm: float) -> None:
    assert decode(word2(code), PANEL.labels[0o271]).range_nm == range_nm


def test_only_the_variant_divides_its_range_by_20_where_bit_23_is_set() -> None:
    assert decode(word2(2, b23=1), PANEL.labels[0o271]).range_nm == 10.0
    assert decode(word2(2, b23=1), DIVIDED.labels[0o271]).range_nm == 0.5
    assert decode(word2(2), DIVIDED.labels[0o271]).range_nm == 10.0
    assert decode(word2(0, b23=1), DIVIDED.labels[0o271]).range_nm == 16.0


def test_the_words_pass_the_label_set_as_normal_discretes() -> None:
    words = [word1(), word2(1), word429(0o273, {})]
    assert decode429(words, PANEL).status.tolist() == [Status.NORMAL] * 3
    assert DIVIDED.labels.keys() == PANEL.labels.keys() == {0o270, 0o271, 0o273}


def test_a_panel_is_known_by_its_fields_and_one_of_other_widths_is_refused(tmp_path: Path) -> None:
    assert is_panel(load_definitions("wxr_panel"))
    assert is_panel(load_definitions("wxr_panel_divided_range"))
    assert not is_panel(load_definitions("iru_704"))
    (tmp_path / "mine.toml").write_text(
        "[mine]\nequipment_id = 0x02F\nextends = 'wxr_panel'\nrows = [{ label = '270', name = 'n', encoding = 'disc', "
        "fields = { mode = [14, 16], tilt = [17, 22], gain = [23, 29] }, source = 's', confidence = 'c' }]"
    )
    with pytest.raises(DefinitionError, match=r"\[mine\] label 270: (tilt has 6|gain has 7) bits"):
        is_panel(load_definitions(tmp_path / "mine.toml"))
