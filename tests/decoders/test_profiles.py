"""Radar profiles are data that is checked when it is read."""

from dataclasses import replace
from typing import Any

import pytest

from decoders import formats
from decoders.profiles import load_profile


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
    [{"bits_per_bin": 5}, {"bins": 511}, {"scan_angle_zero": "down"}, {"faults": ("cooling",)}, {"modes": ()}],
)
def test_settings_that_no_word_can_have_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="profile arinc708"):
        replace(load_profile("arinc708"), **change)
