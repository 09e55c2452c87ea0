"""Each body of a packet is read as its layout declares it, or refused."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders import layouts
from decoders.racklink import (
    ChannelCount,
    Hello,
    HelloChannel,
    MalformedBody,
    Packet,
    heartbeat,
    hello,
    radar_word,
    time_mark,
    words429,
)


def made(kind: int, body: bytes, time_ns: int = 1000) -> Packet:
    return Packet(kind, 1, 0, 0, time_ns, body)


def test_words_come_with_their_device_times() -> None:
    body = struct.pack("<4I", 0, 0x11223344, 2**32 - 1, 0xFFFFFFFF)
    timed = words429(made(0x10, body, 2**40))
    assert timed.time_ns.tolist() == [2**40, 2**40 + 2**32 - 1]
    assert timed.words.tolist() == [0x11223344, 0xFFFFFFFF]
    assert (timed.time_ns.dtype.str[1:], timed.words.dtype.str[1:]) == ("i8", "u4")
    assert (timed.leftover_bytes, timed.well_formed) == (0, True)


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)), min_size=1, max_size=256))
def test_words_are_those_of_the_declared_layout(entries: list[tuple[int, int]]) -> None:
    body = layouts.WORDS_429.build({"words": [{"offset_ns": offset, "word": word} for offset, word in entries]})
    timed = words429(made(0x10, body, 0))
    assert list(zip(timed.time_ns.tolist(), timed.words.tolist(), strict=True)) == entries


@pytest.mark.parametrize(("size", "words", "leftover"), [(0, 0, 0), (7, 0, 7), (13, 1, 5), (257 * 8, 257, 0)])
def test_a_words_body_of_a_wrong_length_keeps_its_whole_words_and_says_so(size: int, words: int, leftover: int) -> None:
    timed = words429(made(0x10, bytes(size)))
    assert (timed.words.size, timed.leftover_bytes, timed.well_formed) == (words, leftover, False)


def test_a_device_time_that_would_overflow_is_malformed() -> None:
    latest = words429(made(0x10, b"\xff" * 8, 2**63 - 2**32))
    assert latest.time_ns.tolist() == [2**63 - 1]
    with pytest.raises(MalformedBody, match="64-bit"):
        words429(made(0x10, bytes(8), 2**63 - 2**32 + 1))


@given(st.integers(0, 2047), st.data())
def test_a_radar_word_of_any_length_is_that_of_the_declared_layout(bits: int, data: st.DataObject) -> None:
    size = (bits + 7) // 8
    payload = data.draw(st.binary(min_size=size, max_size=size))
    body = layouts.WORD_708.build({"bit_count": bits, "data": payload})
    assert radar_word(made(0x20, body)) == (bits, payload)


@pytest.mark.parametrize("body", [b"", b"\1", b"\1\0", b"\x40\6" + bytes(199), b"\x40\6" + bytes(201)])
def test_a_radar_word_whose_bits_and_bytes_disagree_is_malformed(body: bytes) -> None:
    with pytest.raises(MalformedBody, match="do not hold"):
        radar_word(made(0x20, body))


def test_a_hello_names_the_bridge_and_its_channels() -> None:
    body = bytes.fromhex("0d0c0b0a 0201 00290004 05700100")
    assert hello(made(0x01, body)) == Hello(
        0x0A0B0C0D, 0x0102, (HelloChannel(0, 0x29, 0, 4), HelloChannel(5, 0x70, 1, 0))
    )


def test_a_heartbeat_counts_words_by_channel() -> None:
    body = bytes.fromhex("03 01000000 02000000 ff ffffffff 00000080")
    assert heartbeat(made(0x02, body)) == (ChannelCount(3, 1, 2), ChannelCount(255, 2**32 - 1, 2**31))


def test_a_time_mark_is_the_device_time_of_its_edge() -> None:
    assert time_mark(made(0x03, bytes.fromhex("0807060504030201"))) == 0x0102030405060708


@pytest.mark.parametrize(
    ("read", "kind", "body"),
    [(hello, 1, bytes(5)), (hello, 1, bytes(9)), (heartbeat, 2, bytes(10)), (time_mark, 3, bytes(7))],
)
def test_a_body_cut_short_or_drawn_out_is_malformed(read: object, kind: int, body: bytes) -> None:
    assert callable(read)
    with pytest.raises(MalformedBody, match="are no"):
        read(made(kind, body))


@given(st.binary(max_size=64))
def test_any_body_is_read_or_malformed(body: bytes) -> None:
    for kind, read in {1: hello, 2: heartbeat, 3: time_mark, 0x10: words429, 0x20: radar_word}.items():
        try:
            read(made(kind, body))
        except MalformedBody as error:
            assert str(error)


@pytest.mark.parametrize("read", [hello, heartbeat, time_mark, words429, radar_word])
def test_a_body_reader_refuses_a_packet_of_another_type(read: object) -> None:
    assert callable(read)
    with pytest.raises(ValueError, match="type 0x55") as caught:
        read(made(0x55, bytes(8)))
    assert not isinstance(caught.value, MalformedBody)
