"""What a profile decides of an ARINC 708 word: labels, modes, levels, where angles begin, and how bins are cut."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decoders.arinc708 import headers, load_profile, misread_bits, unpack
from decoders.kernels708_bins import mean_step
from tests.decoders.bus import LABEL, MODE, RESERVED_LEVEL, header708, words708


def test_the_six_bit_profile_cuts_the_same_payload_into_256_bins() -> None:
    assert unpack(words708(bytes(8)), "wxr2100_6bit").bins.tolist() == [[0o10, 0o32, 0o54, 0o76] * 64]


def test_a_profile_whose_scan_angle_starts_at_the_tail_is_turned_by_half_a_turn() -> None:
    encoder = replace(load_profile("arinc708"), scan_angle_zero="tail")
    turned = unpack(words708(*(header708(scan_angle=code) for code in (0, 2048, 3072))), encoder)
    assert turned.scan_angle_deg.tolist() == [-180.0, 0.0, 90.0]


def test_labels_that_a_profile_does_not_name_are_carried_and_flagged() -> None:
    found = headers(np.frombuffer(b"".join(header708(label=code) for code in range(256)), np.uint8).reshape(-1, 8))
    assert found.label.tolist() == list(range(256))
    assert {code for code in range(256) if not found.unusual[code] & LABEL} == {0o055, 0o057}


@pytest.mark.parametrize(("name", "reserved"), [("arinc708", {7}), ("arinc708a", set()), ("wxr2100_6bit", {7})])
def test_a_mode_without_a_meaning_is_carried_and_flagged(name: str, reserved: set[int]) -> None:
    header = np.frombuffer(b"".join(header708(mode=code) for code in range(8)), np.uint8).reshape(-1, 8)
    found = headers(header, name)
    assert found.mode.tolist() == list(range(8))
    assert {code for code in range(8) if found.unusual[code] & MODE} == reserved


@pytest.mark.parametrize("bin_", [0, 1, 31, 32, 255, 511])
@pytest.mark.parametrize("level", range(8))
def test_a_reserved_level_in_any_bin_is_carried_and_flagged(level: int, bin_: int) -> None:
    payload = (level << 3 * bin_).to_bytes(192, "little")
    found = unpack(words708(header708(), payload=payload))
    assert found.bins[0, bin_] == level
    assert np.count_nonzero(found.bins) == int(level > 0)
    assert found.unusual[0] == (RESERVED_LEVEL if level == 5 else 0)


def test_a_radar_with_several_reserved_levels_has_each_flagged_and_six_bits_have_none() -> None:
    few = replace(load_profile("arinc708"), levels=("black", "green", "yellow", "red", *["reserved"] * 4))
    payloads = [(level << 9).to_bytes(192, "little") for level in range(8)]
    array = np.concatenate([words708(header708(), payload=payload) for payload in payloads])
    assert unpack(array, few).unusual.tolist() == [0] * 4 + [RESERVED_LEVEL] * 4
    ramp = sum(level << (6 * level) for level in range(64)).to_bytes(192, "little")
    assert unpack(words708(header708(), payload=ramp), "wxr2100_6bit").unusual.tolist() == [0]


@pytest.mark.parametrize(("zero", "start"), [("nose", 0.0), ("tail", 180.0)])
@pytest.mark.parametrize(("sense", "sign"), [("clockwise", 1), ("counterclockwise", -1)])
def test_every_scan_angle_counts_from_the_zero_and_in_the_sense_of_the_profile(
    zero: str, start: float, sense: str, sign: int
) -> None:
    changes: dict[str, Any] = {"scan_angle_zero": zero, "scan_angle_sense": sense}
    profile = replace(load_profile("arinc708"), **changes)
    codes = range(4096)
    array = np.frombuffer(b"".join(header708(scan_angle=code) for code in codes), np.uint8).reshape(-1, 8)
    expected = [(start + sign * code * 360 / 4096 + 180) % 360 - 180 for code in codes]
    assert headers(array, profile).scan_angle_deg.tolist() == expected


@pytest.mark.parametrize("bits", [3, 6])
@pytest.mark.parametrize("bins", [64, 72, 96, 128, 200, 256])
def test_a_profile_of_another_word_length_unpacks_its_own_words(bins: int, bits: int) -> None:
    base = load_profile({3: "arinc708", 6: "wxr2100_6bit"}[bits])
    other = replace(base, word_bits=64 + bins * bits, bins=bins)
    payload = np.random.default_rng(1).bytes(bins * bits // 8)
    expected = [int.from_bytes(payload, "little") >> bits * k & 2**bits - 1 for k in range(bins)]
    found = unpack(np.frombuffer(header708(range=4) + payload, np.uint8)[None], other)
    assert (found.bins.tolist(), found.range_nm.tolist()) == ([expected], [20.0])


def test_bins_that_climb_and_fall_slowly_tell_whether_they_were_cut_at_the_wrong_bits() -> None:
    slope = np.abs(np.arange(512) % 32 - 16).astype(np.uint8)  # 0 to 16 and back
    six, three = np.tile(slope * 3, (20, 1)), np.tile(slope // 3, (20, 1))
    assert [misread_bits(six), misread_bits(three)] == [None, None]
    assert misread_bits(np.stack([six & 7, six >> 3], axis=-1).reshape(20, -1)) == 6
    assert misread_bits(three[:, ::2] + np.uint8(8) * three[:, 1::2]) == 3


def test_the_mean_step_is_that_of_numpy() -> None:
    bins = np.random.default_rng(1).integers(0, 64, (9, 256)).astype(np.uint8)
    for apart in (1, 2):
        steps = bins[:, apart:].astype(int) - bins[:, :-apart]
        assert mean_step(bins, apart) == np.abs(steps).mean()
