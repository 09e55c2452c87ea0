"""RackLink over CAN: blocks of words, radar words put together, and a clock of 32 bits that goes on."""

import struct
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders import formats as f
from decoders.can_frames import Recorded
from decoders.framing import Packet
from decoders.racklink import radar_word, words429
from decoders.racklink_can import CanFramer

WRAP_NS = 2**32 * 1000  # where the clock of a CanFramer begins
WORD = bytes(range(200))


def record(channel: int, kind: int, index: int, data: bytes) -> bytes:
    identifier = 0b10110 << 24 | channel << 16 | kind << 12 | index
    return struct.pack("<QIBB", 9, 1 << 31 | identifier, 0, len(data)) + data


def word(channel: int, value: int, us: int) -> bytes:
    return record(channel, 0, value & 0xFF, struct.pack("<II", value, us))


def segments(
    channel: int, counter: int, time_ns: int, data: bytes = WORD, bits: int | None = None, flags: int = 0, step: int = 7
) -> list[bytes]:
    whole = struct.pack("<QHB", time_ns, 8 * len(data) if bits is None else bits, flags) + data
    pieces = [whole[at : at + step] for at in range(0, len(whole), step)]
    return [record(channel, 1, k, bytes([counter]) + piece) for k, piece in enumerate(pieces)]


def heartbeat(channel: int, received: int, lost: int) -> bytes:
    return record(channel, 2, 0, struct.pack("<II", received, lost))


def feed(*frames: bytes, framer: CanFramer | None = None) -> list[Packet]:
    framer = framer or CanFramer(Recorded())
    before, data = framer.received, b"".join(frames)
    packets = framer.feed(data)
    assert framer.received == before + len(data) == framer.framed + framer.skipped + framer.pending
    return packets


def faults(framer: CanFramer) -> dict[str, int]:
    return {name: count for name, count in framer.counters().items() if name in CanFramer.FAULTS and count}


def test_words_of_a_chunk_become_one_block_for_each_channel() -> None:
    packets = feed(word(1, 0x600C808B, 10), word(2, 0xE00190A1, 15), word(1, 0x0000008B, 370))
    assert [(packet.type, packet.channel, packet.sequence) for packet in packets] == [(0x10, 1, 0), (0x10, 2, 1)]
    first, second = (words429(packet) for packet in packets)
    assert first.words.tolist() == [0x600C808B, 0x8B]
    assert first.time_ns.tolist() == [WRAP_NS + 10_000, WRAP_NS + 370_000]
    assert second.words.tolist() == [0xE00190A1]


@pytest.mark.parametrize("step", [7, 63])
@pytest.mark.parametrize(("data", "bits"), [(WORD, 1600), (WORD[:10], 77), (bytes(255), 2040)])
def test_a_radar_word_is_put_together_from_its_segments(data: bytes, bits: int, step: int) -> None:
    (packet,) = feed(*segments(3, 200, 5_000_123, data, bits, flags=8, step=step))
    assert (packet.type, packet.channel, packet.flags) == (0x20, 3, 8)
    assert packet.time_ns == WRAP_NS + 5_000_123
    assert radar_word(packet) == (bits, data)


def test_the_padding_of_a_last_fd_frame_is_no_part_of_the_word() -> None:
    *rest, last = segments(0, 1, 0, step=63)
    payload = last[struct.calcsize("<QIBB") :]
    (packet,) = feed(*rest, record(0, 1, len(rest), payload.ljust(24, b"\0")))
    assert radar_word(packet).data == WORD


def test_the_segments_of_two_radars_may_interleave() -> None:
    pairs = zip(segments(0, 1, 0), segments(5, 9, 0, bytes(200)), strict=True)
    packets = feed(*(frame for pair in pairs for frame in pair))
    assert [(packet.channel, radar_word(packet).data) for packet in packets] == [(0, WORD), (5, bytes(200))]


@pytest.mark.parametrize("lost", [1, 15, 30])
def test_a_missing_segment_costs_its_word_and_no_other(lost: int) -> None:
    framer, frames = CanFramer(Recorded()), segments(0, 1, 0)
    del frames[lost]
    packets = feed(*frames, *segments(0, 2, 1000), framer=framer)
    assert [packet.time_ns - WRAP_NS for packet in packets] == [1000]
    assert faults(framer) == {"incomplete_708": 1}


def test_a_repeated_segment_costs_its_word_and_no_other() -> None:
    framer, frames = CanFramer(Recorded()), segments(0, 1, 0)
    packets = feed(*frames[:5], frames[4], *frames[5:], *segments(0, 2, 1000), framer=framer)
    assert len(packets) == 1
    assert faults(framer) == {"incomplete_708": 1}


def test_a_word_whose_first_segment_is_missing_does_not_continue_the_one_before() -> None:
    framer = CanFramer(Recorded())
    packets = feed(*segments(0, 1, 0)[:4], *segments(0, 2, 0)[4:], framer=framer)
    assert packets == []
    assert faults(framer) == {"incomplete_708": 1}


def test_the_same_word_twice_is_used_once() -> None:
    framer = CanFramer(Recorded())
    (packet,) = feed(word(1, 5, 10), word(1, 5, 10), word(1, 5, 20), framer=framer)
    assert words429(packet).words.tolist() == [5, 5]
    assert faults(framer) == {"repeated_frames": 1}


def test_a_heartbeat_comes_behind_the_words_that_it_counts() -> None:
    frames = (word(1, 5, 10), *segments(0, 1, 0), heartbeat(1, 1, 7), word(1, 6, 20))
    packets = feed(*frames)
    assert [packet.type for packet in packets] == [0x10, 0x20, 0x02, 0x10]
    assert packets[2].body == struct.pack("<BII", 1, 1, 7)
    assert [packet.sequence for packet in packets] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    "frame",
    [
        record(1, 0, 0x8C, struct.pack("<II", 0x8B, 0)),
        record(1, 0, 0x8B, b"\x8b"),
        record(1, 1, 0, b"\1"),
        record(1, 2, 0, bytes(7)),
    ],
    ids=["index is not the label", "short word", "empty segment", "short heartbeat"],
)
def test_a_frame_that_contradicts_its_identifier_is_counted(frame: bytes) -> None:
    framer = CanFramer(Recorded())
    assert feed(frame, framer=framer) == []
    assert faults(framer) == {"bad_frames": 1}


def test_frames_of_others_are_skipped_and_counted() -> None:
    framer = CanFramer(Recorded())
    other = struct.pack("<QIBB", 9, 1 << 31 | 0b10111 << 24, 0, 2) + b"no"
    assert feed(other, record(1, 9, 0, b"no"), framer=framer) == []
    assert (faults(framer), framer.skipped) == ({"foreign_frames": 2}, 2 * len(other))


@pytest.mark.parametrize("us", [(2**32 - 5, 3), (2**32 - 1, 0), (100, 2**31 - 1)])
def test_the_clock_goes_on_when_its_low_bits_wrap(us: Sequence[int]) -> None:
    packets = feed(word(1, 5, us[0]), word(1, 6, us[1]))
    first, second = (time_ns for packet in packets for time_ns in words429(packet).time_ns.tolist())
    assert second - first == (us[1] - us[0]) % 2**32 * 1000


def test_a_clock_that_goes_back_begins_a_new_block() -> None:
    packets = feed(word(1, 5, 5000), word(1, 6, 4000))
    assert [packet.time_ns - WRAP_NS for packet in packets] == [5_000_000, 4_000_000]


def test_radar_words_and_label_words_share_one_clock() -> None:
    label, radar = feed(word(1, 5, 2**32 - 100), *segments(0, 1, (3 * 2**32 + 100) * 1000 + 7))
    assert radar.time_ns - label.time_ns == 200_007


def test_no_block_is_larger_than_a_packet_may_be() -> None:
    packets = feed(*(word(1, 0x100 * k, k) for k in range(600)))
    assert [len(words429(packet).words) for packet in packets] == [256, 256, 88]
    assert all(words429(packet).well_formed for packet in packets)


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.binary(max_size=64)), max_size=30))
def test_any_frames_give_packets_that_can_be_read(frames: list[tuple[int, bytes]]) -> None:
    prefix = 1 << 31 | f.CAN_PREFIX << 24
    data = [struct.pack("<QIBB", 0, prefix | number & 0xFF_FFFF, 0, len(body)) + body for number, body in frames]
    for packet in feed(*data):
        assert 0 <= packet.time_ns < 2**63
        if packet.type == f.WORDS_429:
            assert words429(packet).well_formed
        elif packet.type == f.WORD_708:
            assert len(radar_word(packet).data) == (radar_word(packet).bit_count + 7) // 8


def test_a_successor_goes_on_with_the_counts() -> None:
    before, after = CanFramer(Recorded()), CanFramer(Recorded())
    feed(word(1, 5, 10), word(1, 5, 10), record(1, 9, 0, b""), framer=before)
    after.succeed(before)
    assert after.counters() == before.counters()
