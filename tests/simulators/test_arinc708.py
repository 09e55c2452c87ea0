"""The ARINC 708 encoder against published words and bit strings worked out here."""

import numpy as np
import pytest

from simulators.arinc708 import encode, encode_block


def test_the_published_weather_word_comes_out_to_the_bit() -> None:
    word = encode(
        np.arange(512) % 8,
        scan_angle_deg=349.98,
        tilt_deg=-3.25,
        range_nm=160,
        annunciations=0b00010,
        faults=0b0000001,
        mode=6,
        gain_db=0.0,
    )
    assert word[:8].hex() == "b443047a0e80767c"
    assert word[8:] == bytes.fromhex("88c6fa") * 64


def test_the_bench_generators_header_comes_out_to_the_bit() -> None:
    word = encode(
        np.zeros(512, int),
        scan_angle_deg=10.81,
        tilt_deg=-16,
        range_nm=25,
        control_accept=1,
        faults=0b1000000,
        stabilised=False,
        mode=0,
        data_accept=1,
    )
    assert word[:8].hex() == "b4010001f817da03"
    assert word[8:] == bytes(192)


@pytest.mark.parametrize(("bins", "width"), [(512, 3), (256, 6)])
def test_range_bins_follow_each_other_least_significant_bit_first(bins: int, width: int) -> None:
    codes = np.random.default_rng(1).integers(0, 2**width, bins)
    word = encode(codes, scan_angle_deg=0, tilt_deg=0, range_nm=10)
    assert len(word) == 200
    wire = f"{int.from_bytes(word, 'little'):01600b}"[::-1][64:]
    assert [int(wire[k * width : (k + 1) * width][::-1], 2) for k in range(bins)] == codes.tolist()


def test_a_block_is_its_words_one_by_one() -> None:
    angles = np.arange(-90, 90.5, 0.5)
    bins = np.random.default_rng(2).integers(0, 5, (len(angles), 512))
    block = encode_block(bins, scan_angle_deg=angles, tilt_deg=-2, range_nm=10)
    for row, codes, angle in zip(block, bins, angles, strict=True):
        assert row.tobytes() == encode(codes, scan_angle_deg=angle, tilt_deg=-2, range_nm=10)


def test_320_miles_is_code_zero_and_a_tilt_of_minus_a_quarter_is_all_ones() -> None:
    header = int.from_bytes(encode(np.zeros(512, int), scan_angle_deg=-90, tilt_deg=-0.25, range_nm=320)[:8], "little")
    assert header >> 42 & 0x3F == 0
    assert header >> 29 & 0x7F == 0x7F
    assert header >> 51 & 0xFFF == 3072


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"tilt_deg": 16.0}, "tilt"),
        ({"range_nm": 12}, "multiple of 5"),
        ({"range_nm": 325}, "multiple of 5"),
        ({"mode": 8}, "mode"),
        ({"gain_db": -64.0}, "gain"),
        ({"bins": np.full(512, 8)}, "0 to 7"),
        ({"bins": np.zeros(300, int)}, "300 bins"),
    ],
)
def test_what_the_bits_cannot_hold_is_refused(changed: dict[str, object], message: str) -> None:
    settings: dict[str, object] = {"bins": np.zeros(512, int), "scan_angle_deg": 0, "tilt_deg": 0, "range_nm": 10}
    with pytest.raises(ValueError, match=message):
        encode(**(settings | changed))  # type: ignore[arg-type]
