"""Radar profiles are data that is checked when it is read."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from decoders import formats
from decoders.profiles import ProfileError, load_profile

NAMES = ["arinc708", "arinc708a", "wxr2100_6bit"]


@pytest.mark.parametrize(("name", "bins"), [("arinc708", 512), ("arinc708a", 512), ("wxr2100_6bit", 256)])
def test_every_profile_fills_a_word_of_1600_bits(name: str, bins: int) -> None:
    profile = load_profile(name)
    assert (profile.bins, profile.bins * profile.bits_per_bin, profile.word_bytes) == (bins, 1536, 200)


def test_the_modes_of_arinc_708_are_named_alike_everywhere() -> None:
    assert load_profile("arinc708").modes == tuple(formats.MODES_708)


def test_arinc_708a_gives_three_modes_to_windshear() -> None:
    modes = load_profile("arinc708a").modes
    assert [code for code, name in enumerate(modes) if "windshear" in name] == [3, 5, 7]


@pytest.mark.parametrize(
    "change",
    [
        {"bits_per_bin": 5},
        {"bins": 511},
        {"bins": 256},
        {"word_bits": 1856},
        {"labels": (256,)},
        {"scan_angle_zero": "down"},
        {"scan_angle_sense": "left"},
        {"faults": ("cooling",)},
        {"modes": ()},
        {"levels": ("black",)},
        {"colours": ("#000000",)},
        {"colours": ("black", "white")},
        {"colours": ("#000000",) * 9},
    ],
)
def test_settings_that_no_radar_can_have_are_refused_and_named(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(change))):
        replace(load_profile("arinc708"), **change)


@pytest.mark.parametrize("name", NAMES)
def test_every_level_has_a_name_and_a_colour(name: str) -> None:
    profile = load_profile(name)
    assert len(profile.level_names) == len(profile.palette) == 2**profile.bits_per_bin


def test_the_levels_of_three_bits_have_their_public_names_and_colours_of_their_own() -> None:
    profile = load_profile("arinc708")
    assert profile.level_names[:6] == ("black", "green", "yellow", "red", "magenta", "reserved")
    assert profile.palette == profile.colours


def test_the_levels_of_six_bits_are_called_by_number_and_their_colours_are_blended() -> None:
    profile = replace(load_profile("wxr2100_6bit"), colours=("#000000", "#3f7e00", "#3f7eff"))
    assert profile.level_names[0::63] == ("level 0", "level 63")
    assert profile.palette[0::63] == ("#000000", "#3f7eff")
    assert profile.palette[21] == "#2a5400"  # two thirds of the first step, which is half of the 63


def user_file(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_profile_of_ones_own_extends_a_named_one(tmp_path: Path) -> None:
    path = user_file(tmp_path, '[my_radar]\nextends = "arinc708a"\nscan_angle_zero = "tail"\nlabels = [0o055, 0o060]\n')
    expected = replace(load_profile("arinc708a"), name="my_radar", scan_angle_zero="tail", labels=(0o055, 0o060))
    assert load_profile(path) == load_profile(str(path)) == expected


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "mine.toml has 0 tables"),
        ('[a]\nextends = "arinc708"\n[b]\n', "mine.toml has 2 tables"),
        ("a = 3", r"mine.toml:1 \[a\]: a profile is a table"),
        ('[a]\nextends = "arinc708"\nname = "b"', r"mine.toml:3 \[a\] name: a profile is called what its table"),
        ("[a", "mine.toml is no TOML"),
        ("[a]\nbins = 512", r"mine.toml:2 \[a\] word_bits: .*[Ff]ield required|[Mm]issing"),
        ('[a]\nextends = "arinc709"', r"mine.toml:2 \[a\] extends: no profile 'arinc709': use one of"),
        ('[a]\nextends = ["x"]', r"mine.toml:2 \[a\] extends: no profile \['x'\]: use one of"),
        ('[a]\nextends = "b.toml"', "extends: no profile 'b.toml': use one of arinc708, arinc708a, wxr2100_6bit$"),
        ('[a]\nextends = "arinc708"\nlabels = [\n0o55,\n0o400]', r"mine.toml:5 \[a\] labels 1: .*equal to 255$"),
        ('[a]\nextends = "arinc708"\nbin = 3', r"mine.toml:3 \[a\] bin: Unexpected"),
        ('[a]\nextends = "arinc708"\nbins = 300', r"mine.toml:3 \[a\] bins: .*multiple of 8"),
        ('[a]\nextends = "arinc708"\nbins = 56', r"mine.toml:3 \[a\] bins: .*greater than or equal to 64"),
        ('[a]\nextends = "arinc708"\nbins = 256', r"mine.toml:2 \[a\]: word_bits is 1600, but .* are 832"),
        ('[a]\nextends = "arinc708"\nbits_per_bin = 4', r"mine.toml:3 \[a\] bits_per_bin: .*3 or 6"),
        ('[a]\nextends = "arinc708"\nmodes = ["on"]', r"mine.toml:3 \[a\] modes: .*at least 8"),
        ('[a]\nextends = "arinc708"\nlevels = ["on"]', r"mine.toml:2 \[a\]: levels: name all 8 or none"),
        ('[a]\nextends = "arinc708"\ncolours = ["red", "#ffffff"]', r"mine.toml:3 \[a\] colours 0: .*pattern"),
    ],
)
def test_a_mistake_in_a_profile_is_named_with_file_profile_and_key(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(ProfileError, match=complaint) as caught:
        load_profile(user_file(tmp_path, text))
    assert str(tmp_path) in str(caught.value)


def test_a_profile_file_that_is_no_text_or_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ProfileError, match=r"bytes\.toml is no TOML"):
        load_profile(tmp_path / "bytes.toml")
    with pytest.raises(OSError, match=r"none\.toml"):
        load_profile(tmp_path / "none.toml")
