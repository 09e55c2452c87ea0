"""Records of interface cards: words by hand, layouts against their declarations, and garbage that costs only itself."""

import struct
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from construct import Construct
from hypothesis import given
from hypothesis import strategies as st

from decoders import layouts, vendors
from decoders.framing import Packet
from decoders.racklink import MalformedBody, radar_word, words429
from decoders.vendor_records import FRAMERS, RecordFramer

RADAR = bytes.fromhex("b443047a0e80767c") + bytes.fromhex("88c6fa") * 64
# type 1 of version 1, 10 words of 16 bits, channel 3 high speed, gap 4; 0x1_0000_0005 ticks
BALLARD_429 = bytes.fromhex("0101 0a00 05000000 8103 0400 a19001e0 01000000")
BALLARD_708 = (
    bytes.fromhex("0401 7e00 40e20100 0102 6400") + RADAR + bytes(32) + bytes.fromhex("4006 0000 00000000")
)  # 126 words of 16 bits, channel 2, 100 words of data, 1600 bits, 123456 ticks
MAX_429 = bytes.fromhex("40e2010000000000 00000000 03000000 a19001e0 00000000")
MAX_708 = bytes.fromhex("40e2010000000000 00000000 64000000 00000000 00000000") + RADAR + bytes(56)
FILE_708 = bytes(range(18)) + RADAR
DECLARED: dict[str, tuple[np.dtype[np.void], "Construct[Any, Any]"]] = {
    "SEQRECORD_429": (vendors.SEQRECORD_429, layouts.SEQRECORD_429),
    "SEQRECORD_708": (vendors.SEQRECORD_708, layouts.SEQRECORD_708),
    "MXF_A429": (vendors.MXF_A429, layouts.MXF_A429),
    "MXF_A708": (vendors.MXF_A708, layouts.MXF_A708),
    "RDR4B": (vendors.RDR4B, layouts.RDR4B),
}
SIZES = {"SEQRECORD_429": 20, "SEQRECORD_708": 252, "MXF_A429": 24, "MXF_A708": 280, "RDR4B": 218}
WHOLE = {"seqrecord": BALLARD_429, "mxf429": MAX_429, "mxf708": MAX_708, "rdr4b": FILE_708}


def framer(layout: str, channel: int = 0, **said: Any) -> RecordFramer:
    reading = vendors.READINGS[layout]
    return FRAMERS[layout](vendors.Reading(**{**vars(reading), **said}), channel)


def test_records_have_the_sizes_of_the_cards_own_structures() -> None:
    sizes = {name: (fast.itemsize, declared.sizeof()) for name, (fast, declared) in DECLARED.items()}
    assert sizes == {name: (size, size) for name, size in SIZES.items()}


@pytest.mark.parametrize("name", DECLARED)
@given(data=st.data())
def test_the_fast_reader_finds_every_field_where_the_declaration_has_it(name: str, data: st.DataObject) -> None:
    record = data.draw(st.binary(min_size=SIZES[name], max_size=SIZES[name]))
    fast, declared = DECLARED[name]
    slow = declared.parse(record)
    (found,) = np.frombuffer(record, fast)
    for field in fast.names or ():
        value = found[field]
        if fast[field].kind == "V":
            listed = slow[field] if name == "RDR4B" else [*slow[field], *slow.get("extra", [])]
            expected = listed if isinstance(listed, bytes) else struct.pack(f"<{len(listed)}H", *listed)
            assert value.tobytes() == expected
        else:
            assert int(value) == slow[field]


def test_a_ballard_file_gives_both_buses_with_channel_and_time_of_64_bits() -> None:
    reader = framer("seqrecord")
    word, radar = reader.feed(BALLARD_429 + BALLARD_708)
    assert word == Packet(0x10, 3, 0, 0, 1000 * (2**32 + 5), bytes.fromhex("00000000 a19001e0"))
    assert (radar.type, radar.channel, radar.flags, radar.time_ns) == (0x20, 2, 0, 123_456_000)
    assert radar_word(radar) == (1600, RADAR)
    assert reader.counters() | {"received": 272, "framed": 272, "skipped": 0} == reader.counters()


def test_words_of_a_channel_are_one_packet_while_they_are_alike_and_in_time() -> None:
    def word(low: int, channel: int = 1, flags: int = 0) -> bytes:
        return struct.pack("<HHIHHII", 1, 10, low, channel << 8 | flags, 0, low, 0)

    stream = word(10) + word(11) + word(12, 2) + word(13) + word(14, 1, 0x10) + word(9)
    found = framer("seqrecord").feed(stream)
    assert [(p.channel, p.flags, (words429(p).time_ns // 1000).tolist()) for p in found] == [
        (1, 0, [10, 11, 13]),
        (2, 0, [12]),
        (1, 2, [14]),
        (1, 0, [9]),
    ]


@pytest.mark.parametrize(
    ("activity", "flags"), [(0x01, 0), (0x10, 2), (0x04, 4), (0x08, 8), (0x02, 8), (0x20, 0x10), (0xFF, 0x1E)]
)
def test_errors_of_arinc_429_that_ballard_s_cards_see_become_our_flags(activity: int, flags: int) -> None:
    (found,) = framer("seqrecord").feed(BALLARD_429[:8] + bytes([activity]) + BALLARD_429[9:])
    assert found.flags == flags


@pytest.mark.parametrize(
    ("activity", "flags"), [(0x01, 0), (0x10, 4), (0x04, 4), (0x40, 8), (0x20, 8), (0x02, 8), (0x08, 0x10)]
)
def test_errors_of_arinc_708_that_ballard_s_cards_see_become_our_flags(activity: int, flags: int) -> None:
    (found,) = framer("seqrecord").feed(BALLARD_708[:8] + bytes([activity]) + BALLARD_708[9:])
    assert found.flags == flags


def test_masks_that_are_given_take_the_place_of_the_usual_ones() -> None:
    record = BALLARD_429[:8] + b"\x10" + BALLARD_429[9:]
    assert [p.flags for p in framer("seqrecord", flags_429={0x10: 0x10}).feed(record)] == [0x10]


def test_the_bit_count_of_a_radar_word_decides_and_its_words_where_there_is_none() -> None:
    long = BALLARD_708[:244] + struct.pack("<H", 1856) + BALLARD_708[246:]
    short = BALLARD_708[:244] + struct.pack("<H", 1596) + BALLARD_708[246:]
    fixed = BALLARD_708[:244] + bytes(2) + BALLARD_708[246:]
    assert [radar_word(p).bit_count for p in framer("seqrecord").feed(long + short + fixed)] == [1856, 1596, 1600]


def test_a_count_of_bits_or_words_that_has_no_room_is_counted() -> None:
    reader = framer("seqrecord")
    assert reader.feed(BALLARD_708[:244] + struct.pack("<H", 1857) + BALLARD_708[246:]) == []
    assert reader.feed(BALLARD_708[:10] + bytes(2) + BALLARD_708[12:244] + bytes(2) + BALLARD_708[246:]) == []
    assert reader.bad_records == 2


def test_records_of_other_buses_are_stepped_over_and_counted() -> None:
    other = struct.pack("<HH", 0x0103, 20) + bytes(36)
    reader = framer("seqrecord")
    assert len(reader.feed(BALLARD_429 + other + BALLARD_429)) == 1  # the two are of one channel and time
    assert (reader.foreign_records, reader.bad_records, reader.skipped) == (1, 0, 0)


@pytest.mark.parametrize("damage", [b"\1\1\x0b\0", b"\1\1\0\0", b"\x63\0\x0a\0", b"\xff\xff"])
def test_a_bad_type_or_count_costs_its_own_bytes_alone(damage: bytes) -> None:
    reader = framer("seqrecord")
    (packet,) = reader.feed(BALLARD_429 + damage + BALLARD_429)
    assert words429(packet).words.tolist() == [0xE00190A1] * 2
    assert (reader.bad_records, reader.skipped) == (1, len(damage))


@pytest.mark.parametrize("place", range(20))
def test_a_byte_that_is_lost_costs_its_record_alone(place: int) -> None:
    reader = framer("seqrecord")
    torn = BALLARD_429[:place] + BALLARD_429[place + 1 :]
    (packet,) = reader.feed(BALLARD_429 + torn + 3 * BALLARD_429)
    assert words429(packet).words.tolist() == [0xE00190A1] * 4
    assert reader.skipped == 19


def test_what_looks_like_a_record_of_another_bus_swallows_no_word_behind_it() -> None:
    reader = framer("seqrecord")
    like = struct.pack("<HH", 0x0103, 40) + bytes(20)  # 80 bytes, says the count
    (packet,) = reader.feed(BALLARD_429 + like + 5 * BALLARD_429)
    assert len(words429(packet).words) == 6
    assert (reader.foreign_records, reader.bad_records) == (0, 1)


def test_a_max_technologies_word_has_its_time_and_tells_of_repetitions() -> None:
    reader = framer("mxf429", 7)
    (packet,) = reader.feed(MAX_429)
    assert packet == Packet(0x10, 7, 0, 0, 123_456, bytes.fromhex("00000000 a19001e0"))
    assert reader.repetitions_untold == 3


@pytest.mark.parametrize(("unit", "size"), [(16, 100), (8, 200), (1, 1600)])
def test_a_max_technologies_radar_word_has_as_many_bits_as_its_size_says(unit: int, size: int) -> None:
    record = MAX_708[:12] + struct.pack("<I", size) + MAX_708[16:]
    (packet,) = framer("mxf708", 5, size_bits=unit).feed(record)
    assert (packet.channel, packet.flags, packet.time_ns, radar_word(packet)) == (5, 0, 123_456, (1600, RADAR))


def test_any_control_bit_of_max_technologies_spoils_a_word_unless_masks_say_otherwise() -> None:
    radar, word = (record[:8] + struct.pack("<I", 0x20) + record[12:] for record in (MAX_708, MAX_429))
    assert [p.flags for p in framer("mxf708").feed(radar)] == [4]
    assert [p.flags for p in framer("mxf429").feed(word)] == [2]
    assert [p.flags for p in framer("mxf708", flags_708={8: 0x20, 4: 0x40}).feed(radar)] == [8]


def test_words_of_an_rdr_4b_follow_each_other_190_times_a_second() -> None:
    reader = framer("rdr4b", 4)
    packets = reader.feed(FILE_708 * 3) + reader.feed(FILE_708)
    assert [packet.time_ns for packet in packets] == [0, 5_263_158, 10_526_316, 15_789_474]  # k / 190 s
    assert {(packet.channel, radar_word(packet)) for packet in packets} == {(4, (1600, RADAR))}
    assert reader.counters()["timed_by_count"] == 4


def test_a_time_that_no_clock_has_is_refused_where_words_are_read() -> None:
    (packet,) = framer("seqrecord").feed(BALLARD_429[:4] + b"\xff" * 4 + BALLARD_429[8:16] + b"\xff" * 4)
    with pytest.raises(MalformedBody, match="does not fit"):
        words429(packet)


@pytest.mark.parametrize("layout", FRAMERS)
@given(data=st.data())
def test_any_bytes_are_accounted_for_and_may_be_cut_where_the_layout_says(layout: str, data: st.DataObject) -> None:
    pieces = st.one_of(st.binary(max_size=60), st.sampled_from([WHOLE[layout], BALLARD_708, BALLARD_429[:11]]))
    stream = b"".join(data.draw(st.lists(pieces, max_size=12)))
    whole, cut = framer(layout), framer(layout)
    expected = whole.feed(stream)
    assert whole.received == len(stream) == whole.framed + whole.skipped
    ends = np.cumsum([0, *(span.size for span in whole.spans(stream, 0))]).tolist()
    assert ends[-1] <= len(stream)
    assert len(stream) - ends[-1] < vendors.SEQRECORD_LONGEST
    found = [packet for start, end in pairwise([*ends, len(stream)]) for packet in cut.feed(stream[start:end])]
    assert words_in(found) == words_in(expected)
    assert (cut.framed, cut.skipped) == (whole.framed, whole.skipped)


def words_in(packets: list[Packet]) -> list[tuple[int, int, bytes]]:
    """Each word with channel and time, however they were gathered."""
    found = []
    for packet in packets:
        size = 8 if packet.type == 0x10 else len(packet.body)
        for at in range(0, len(packet.body), size):
            offset = int.from_bytes(packet.body[at : at + 4], "little") if packet.type == 0x10 else 0
            found.append((packet.channel, packet.time_ns + offset, packet.body[at + size - 4 : at + size]))
    return sorted(found)


def test_a_successor_goes_on_with_the_counts() -> None:
    before, after = framer("rdr4b"), framer("rdr4b")
    before.feed(FILE_708 + b"torn")
    after.succeed(before)
    assert after.counters() == before.counters()
