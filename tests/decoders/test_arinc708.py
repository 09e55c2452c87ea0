"""Radials of ARINC 708 words: worked words, the declared layout, and one test for each fault of public decoders."""

import math
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders import formats, layouts
from decoders.arinc708 import Header, Radials, headers, load_profile, unpack
from decoders.racklink import Framer
from simulators import racklink
from tests.decoders.bus import RESERVED_LEVEL, SPARE_11, SPARE_48, SPARE_63, header708, words708

PROFILES = ["arinc708", "arinc708a", "wxr2100_6bit"]
HEADERS = st.binary(min_size=8, max_size=8)


def radial(**fields: int) -> Radials:
    return unpack(words708(header708(**fields)))


def scalars(radials: Radials) -> dict[str, float]:
    return {name: getattr(radials, name)[0].item() for name in Radials._fields if name != "bins"}


def test_a_word_of_a_weather_radar_decodes_as_worked_out() -> None:
    radials = unpack(words708(bytes.fromhex("b443047a0e80767c")))
    assert scalars(radials) == {
        "label": 0o055,
        "control_accept": 3,
        "slave": False,
        "annunciations": 0b00010,
        "faults": 0b0000001,
        "stabilised": True,
        "mode": 6,
        "tilt_deg": -3.25,
        "gain_db": 0.0,
        "range_nm": 160.0,
        "data_accept": 3,
        "scan_angle_deg": 3982 * 360 / 4096 - 360,
        "unusual": RESERVED_LEVEL,
    }
    assert round(radials.scan_angle_deg[0] + 360, 2) == 349.98
    assert radials.bins.tolist() == [list(range(8)) * 64]


def test_a_word_of_a_bench_generator_decodes_as_worked_out() -> None:
    fields = scalars(unpack(words708(bytes.fromhex("b4010001f817da03"))))
    assert math.isnan(fields.pop("gain_db"))
    assert fields == {
        "label": 0o055,
        "control_accept": 1,
        "slave": False,
        "annunciations": 0,
        "faults": 0b1000000,
        "stabilised": False,
        "mode": 0,
        "tilt_deg": -16.0,
        "range_nm": 25.0,
        "data_accept": 1,
        "scan_angle_deg": 123 * 360 / 4096,
        "unusual": RESERVED_LEVEL,
    }


@given(st.lists(HEADERS, min_size=1, max_size=8))
def test_every_field_is_that_of_the_declared_layout(headers: list[bytes]) -> None:
    radials = unpack(words708(*headers))
    for i, header in enumerate(headers):
        declared = layouts.RADAR_HEADER.parse(header)
        for name in (
            "label",
            "control_accept",
            "slave",
            "annunciations",
            "faults",
            "stabilised",
            "mode",
            "data_accept",
        ):
            assert getattr(radials, name)[i] == getattr(declared, name)
        tilt, angle = declared.tilt, declared.scan_angle
        assert radials.tilt_deg[i] == (tilt - 128 if tilt >= 64 else tilt) / 4
        assert radials.scan_angle_deg[i] == (angle - 4096 if angle >= 2048 else angle) * 360 / 4096
        assert radials.range_nm[i] == (5 * declared.range or 320)
        assert math.isnan(radials.gain_db[i]) if declared.gain == 63 else radials.gain_db[i] == -declared.gain
        expected = [declared.label not in (0o055, 0o057), declared.mode == 7]
        expected += [declared.spare_11_12 > 0, declared.spare_48 > 0, declared.spare_63 > 0, True]
        assert [radials.unusual[i] >> bit & 1 for bit in range(8)] == [*expected, False, False]


@pytest.mark.parametrize(("name", "place"), (formats.HEADER_708 | formats.SPARE_708).items())
def test_each_field_at_its_ends_lies_where_the_layout_declares_it(name: str, place: tuple[int, int]) -> None:
    first, width = place
    zeros = dict.fromkeys([*formats.HEADER_708, *formats.SPARE_708], 0)
    full = layouts.RADAR_HEADER.build(zeros | {name: 2**width - 1})
    assert int.from_bytes(full, "little") == (2**width - 1) << first
    top = layouts.RADAR_HEADER.build(zeros | {name: 2 ** (width - 1)})
    assert int.from_bytes(top, "little") == 1 << (first if name == "label" else first + width - 1)


@given(st.sampled_from(PROFILES), st.binary(min_size=192, max_size=192))
def test_bin_k_is_its_own_bits_of_the_payload_least_significant_first(name: str, payload: bytes) -> None:
    profile = load_profile(name)
    bits = int.from_bytes(payload, "little")
    size = profile.bits_per_bin
    expected = [bits >> (k * size) & (2**size - 1) for k in range(profile.bins)]
    assert unpack(words708(bytes(8), payload=payload), name).bins.tolist() == [expected]


def test_fault_a_tilt_of_minus_a_quarter_read_as_minus_1008() -> None:
    assert radial(tilt=127).tilt_deg[0] == -0.25
    assert radial(tilt=64).tilt_deg[0] == -16.0
    assert radial(tilt=63).tilt_deg[0] == 15.75


def test_fault_spare_bit_48_leaks_into_the_range() -> None:
    assert radial(range=16, spare_48=1).range_nm[0] == radial(range=16).range_nm[0] == 80.0
    assert radial(range=0, spare_48=1).range_nm[0] == 320.0


@pytest.mark.parametrize(
    ("spare", "flag"),
    [
        ({"spare_11": 1}, SPARE_11),
        ({"spare_11": 2}, SPARE_11),
        ({"spare_11": 3}, SPARE_11),
        ({"spare_48": 1}, SPARE_48),
        ({"spare_63": 1}, SPARE_63),
    ],
)
def test_spare_bits_change_no_field_and_are_flagged(spare: dict[str, int], flag: int) -> None:
    flagged, plain = (
        unpack(words708(header708(**spare), payload=bytes(192))),
        unpack(words708(header708(), payload=bytes(192))),
    )
    assert plain.unusual[0] == 0
    assert scalars(flagged) == scalars(plain) | {"unusual": flag}


@pytest.mark.parametrize("field", ["range", "gain", "mode", "label"])
def test_fault_a_code_that_is_not_listed_drops_the_radial(field: str) -> None:
    codes = range(2 ** formats.HEADER_708[field][1])
    radials = unpack(words708(*(header708(**{field: code}) for code in codes)))
    assert all(len(column) == len(codes) for column in radials)
    np.testing.assert_array_equal(radials.bins, np.tile(np.arange(8), (len(codes), 64)))


def test_fault_a_payload_of_label_bytes_is_taken_for_headers() -> None:
    radials = unpack(words708(header708(range=8), payload=b"\xb4" * 192))
    assert (radials.label.tolist(), radials.range_nm.tolist()) == ([0o055], [40.0])
    assert radials.bins[0, :8].tolist() == [0xB4B4B4 >> (3 * k) & 7 for k in range(8)]


def test_fault_a_reader_synchronises_on_any_label_byte() -> None:
    """Words in a damaged stream are found by the link's framing alone, whatever bytes they hold."""
    whole = header708(range=8) + b"\xb4" * 192
    packets = [racklink.encode(formats.WORD_708, 0, k, k, racklink.word_708(whole)) for k in range(6)]
    framer = Framer()
    found = framer.feed(
        packets[0] + packets[1][:90] + packets[2] + b"\xb4" * 500 + packets[3] + packets[4][7:] + packets[5]
    )
    assert [packet.sequence for packet in found] == [0, 2, 3, 5]
    assert all(packet.body[2:] == whole for packet in found)


def test_fault_an_encoder_and_a_decoder_disagree_on_zero_and_sense_of_the_scan_angle() -> None:
    """Sources differ, so it is a profile's setting: the same code is four angles."""
    array = np.frombuffer(header708(scan_angle=512), np.uint8)[None]
    settings: list[dict[str, Any]] = [
        {"scan_angle_zero": zero, "scan_angle_sense": sense}
        for zero in ("nose", "tail")
        for sense in ("clockwise", "counterclockwise")
    ]
    angles = [headers(array, replace(load_profile("arinc708"), **change)).scan_angle_deg[0] for change in settings]
    assert angles == [45.0, -45.0, -135.0, 135.0]


def test_fault_the_order_of_the_faults_is_a_constant() -> None:
    """Sources differ on it: the bits stay as sent, and the profile names them."""
    assert [radial(faults=1 << bit).faults[0] for bit in range(7)] == [1 << bit for bit in range(7)]
    turned = replace(load_profile("arinc708"), faults=load_profile("arinc708").faults[::-1])
    assert turned.faults[0] == "transmit_receive"


def test_fault_a_word_with_label_057_is_thrown_away() -> None:
    radials = unpack(words708(bytes.fromhex("f443047a0e80767c")))
    assert (radials.label[0], radials.range_nm[0]) == (0o057, 160.0)


@pytest.mark.parametrize(("code", "gain_db"), [(0, 0.0), (1, -1.0), (62, -62.0)])
def test_gain_is_decibels_below_the_maximum(code: int, gain_db: float) -> None:
    gain = radial(gain=code).gain_db[0]
    assert (gain, np.signbit(gain)) == (gain_db, code > 0)


def test_gain_code_63_is_calibrated_which_is_no_number() -> None:
    assert math.isnan(radial(gain=63).gain_db[0])


@pytest.mark.parametrize(
    ("code", "angle"), [(0, 0.0), (1024, 90.0), (2047, 179.912109375), (2048, -180.0), (3072, -90.0)]
)
def test_the_scan_angle_is_clockwise_from_the_nose_and_never_180(code: int, angle: float) -> None:
    assert radial(scan_angle=code).scan_angle_deg[0] == angle


def test_the_first_bit_of_annunciations_and_faults_is_one() -> None:
    word = np.zeros((2, 200), np.uint8)
    word[0, 13 // 8] = 1 << 13 % 8
    word[1, 18 // 8] = 1 << 18 % 8
    radials = unpack(word)
    assert radials.annunciations.tolist() == [1, 0]
    assert radials.faults.tolist() == [0, 1]


def test_arrays_have_their_declared_types_and_shapes() -> None:
    radials = unpack(words708(bytes(8), bytes(8)))
    types = {name: (column.dtype.str[1:], column.shape) for name, column in radials._asdict().items()}
    names = ["label", "control_accept", "annunciations", "faults", "mode", "data_accept", "unusual"]
    small = dict.fromkeys(names, ("u1", (2,)))
    flags = dict.fromkeys(["slave", "stabilised"], ("b1", (2,)))
    floats = dict.fromkeys(["tilt_deg", "gain_db", "range_nm", "scan_angle_deg"], ("f8", (2,)))
    assert types == small | flags | floats | {"bins": ("u1", (2, 512))}


@pytest.mark.parametrize("shape", [(1, 199), (3, 201), (1, 8)])
def test_words_of_another_length_are_refused_with_both_lengths(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"arinc708 takes \(n, 200\) bytes") as caught:
        unpack(np.zeros(shape, np.uint8))
    assert str(shape) in str(caught.value)


@pytest.mark.parametrize("shape", [(200,), (2, 2, 200), (1, 7), (0, 0)])
@pytest.mark.parametrize("decode", [unpack, headers])
def test_what_is_no_row_of_words_is_refused_with_its_shape(
    decode: Callable[[npt.NDArray[np.uint8]], object], shape: tuple[int, ...]
) -> None:
    with pytest.raises(ValueError, match="at least the 8 of a header") as caught:
        decode(np.zeros(shape, np.uint8))
    assert str(shape) in str(caught.value)


def test_words_that_are_no_bytes_and_unknown_profiles_are_refused() -> None:
    with pytest.raises(ValueError, match="uint8"):
        unpack(np.zeros((1, 200)))
    with pytest.raises(ValueError, match="wxr2100_6bit"):
        unpack(np.zeros((1, 200), np.uint8), "arinc709")


def test_strided_and_read_only_words_unpack_alike() -> None:
    array = words708(bytes.fromhex("b443047a0e80767c"), bytes(8))
    for form in (array, array.copy(), np.asfortranarray(array), np.repeat(array, 2, axis=0)[::2]):
        np.testing.assert_array_equal(unpack(form).bins, unpack(array.copy()).bins)
        assert unpack(form).tilt_deg.tolist() == [-3.25, 0.0]


def test_no_words_are_no_radials() -> None:
    assert unpack(np.zeros((0, 200), np.uint8)).bins.shape == (0, 512)


def same(left: Header, right: Header) -> None:
    for name in Header._fields:
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name), err_msg=name)


@pytest.mark.parametrize("size", [8, 9, 100, 199, 200, 201, 255])
def test_the_header_of_a_word_of_any_length_is_that_of_a_whole_word(size: int) -> None:
    random = np.random.default_rng(size)
    long = random.integers(0, 256, (50, 300), np.uint8)
    radials = unpack(np.concatenate([long[:, :8], np.zeros((50, 192), np.uint8)], axis=1))
    same(headers(long[:, :size]), Header(*(getattr(radials, name) for name in Header._fields)))


@pytest.mark.parametrize("count", [1023, 1024, 1025, 5000])
def test_a_block_of_any_size_is_the_same_as_word_by_word(count: int) -> None:
    array = np.random.default_rng(count).integers(0, 256, (count, 200), np.uint8)
    block = unpack(array)
    for i in (0, 1, 511, 1022, count - 1):
        one = unpack(array[i : i + 1])
        for name in Radials._fields:
            np.testing.assert_array_equal(getattr(block, name)[i : i + 1], getattr(one, name))


def test_no_field_comes_out_that_is_not_declared() -> None:
    declared = {
        *("label", "control_accept", "slave", "annunciations", "faults", "stabilised", "mode", "tilt_deg", "gain_db"),
        *("range_nm", "data_accept", "scan_angle_deg", "unusual"),
    }
    assert set(Header._fields) == declared == set(Radials._fields) - {"bins"}
    bit_struct: Any = layouts.RADAR_HEADER
    layout = {item.name: item.sizeof() for item in bit_struct.subcon.subcon.subcons}
    assert layout == {name: width for name, (_, width) in (formats.HEADER_708 | formats.SPARE_708).items()}
    assert sum(layout.values()) == 8 * formats.HEADER_708_BYTES


@given(st.binary(min_size=200, max_size=1600), st.sampled_from(PROFILES))
def test_any_bytes_are_radials_within_the_bounds_of_their_fields(data: bytes, name: str) -> None:
    array = np.frombuffer(data[: len(data) // 200 * 200], np.uint8).reshape(-1, 200)
    found, profile = unpack(array, name), load_profile(name)
    assert all(len(column) == len(array) for column in found)
    limits = {"control_accept": 3, "annunciations": 31, "faults": 127, "mode": 7, "data_accept": 3, "unusual": 63}
    assert all(getattr(found, field).max() <= limit for field, limit in limits.items())
    assert np.all((found.tilt_deg >= -16) & (found.tilt_deg <= 15.75))
    assert np.all((found.scan_angle_deg >= -180) & (found.scan_angle_deg < 180))
    assert np.all((found.range_nm >= 5) & (found.range_nm <= 320))
    assert np.all(np.isnan(found.gain_db) | (found.gain_db >= -62) & (found.gain_db <= 0))
    assert found.bins.max() < 2**profile.bits_per_bin


@pytest.mark.parametrize("decode", [unpack, headers])
def test_no_more_memory_is_taken_than_the_output_needs(
    decode: Callable[[npt.NDArray[np.uint8]], Header | Radials],
) -> None:
    array = np.random.default_rng(2).integers(0, 256, (20_000, 200), np.uint8)
    decode(array[:1])
    tracemalloc.start()
    found = decode(array)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < sum(getattr(found, name).nbytes for name in found._fields) + 50_000
