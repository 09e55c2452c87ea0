"""CAN frames out of records and of text: garbage is counted and costs no frame but its own."""

import struct
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders.can_frames import Frame, FrameReader, Recorded, Slcan, Socketcand

WORDS = st.tuples(st.integers(0, 2**29 - 1), st.binary(max_size=8))


def record(identifier: int, data: bytes, flags: int = 0) -> bytes:
    return struct.pack("<QIBB", 9, identifier, flags, len(data)) + data


def slcan(identifier: int, data: bytes) -> bytes:
    return b"T%08X%d%b\r" % (identifier, len(data), data.hex().upper().encode())


def socketcand(identifier: int, data: bytes) -> bytes:
    return b"< frame %08X 12.345678 %b >" % (identifier, data.hex().upper().encode())


def fed(reader: FrameReader, stream: bytes, size: int) -> list[Frame]:
    frames = [frame for at in range(0, len(stream), size) for frame in reader.feed(stream[at : at + size])]
    assert sum(frame.size for frame in frames) + reader.skipped + reader.pending == len(stream)
    return frames


@given(st.lists(WORDS, max_size=5))
def test_recorded_frames_come_out_as_they_are(frames: list[tuple[int, bytes]]) -> None:
    stream = b"".join(record(identifier | 1 << 31, data) for identifier, data in frames)
    found = fed(Recorded(), stream, len(stream) or 1)
    assert [(frame.identifier, frame.data) for frame in found] == frames


def test_frames_that_are_not_ours_are_skipped_by_kind() -> None:
    reader = Recorded()
    own, foreign, remote, error = (record(flags | 5, b"data") for flags in (1 << 31, 0, 3 << 30, 5 << 29))
    assert [frame.data for frame in reader.feed(foreign + remote + own + error)] == [b"data"]
    assert reader.counters == {"foreign_frames": 2, "error_frames": 1}
    assert reader.skipped == 3 * len(own)


@pytest.mark.parametrize(("reader", "encode"), [(Slcan, slcan), (Socketcand, socketcand)])
@given(frames=st.lists(WORDS, max_size=5), size=st.integers(1, 50))
def test_text_gives_the_same_frames_whatever_the_pieces(
    reader: type[Slcan] | type[Socketcand],
    encode: Callable[[int, bytes], bytes],
    frames: list[tuple[int, bytes]],
    size: int,
) -> None:
    stream = b"".join(encode(*frame) for frame in frames)
    assert [(frame.identifier, frame.data) for frame in fed(reader(), stream, size)] == frames


@pytest.mark.parametrize(("reader", "encode"), [(Slcan, slcan), (Socketcand, socketcand)])
@given(noise=st.binary(max_size=400), size=st.integers(1, 50))
def test_garbage_costs_at_most_the_frame_it_runs_into(
    reader: type[Slcan] | type[Socketcand], encode: Callable[[int, bytes], bytes], noise: bytes, size: int
) -> None:
    stream = encode(1, b"before") + noise + encode(2, b"hit") + encode(3, b"after")
    found = [frame.identifier for frame in fed(reader(), stream, size)]
    assert found[0] == 1
    assert found[-1] == 3


@pytest.mark.parametrize("noise", [b"\xff\xff", b"T16", b"T1600108B8", b"\x07", b"z\r", b"<", "\u00e9".encode()])
def test_garbage_just_before_a_line_of_slcan_does_not_cost_it(noise: bytes) -> None:
    assert [frame.identifier for frame in Slcan().feed(noise + slcan(0x1601008B, b"12345678"))] == [0x1601008B]


def test_a_server_that_ends_a_frame_in_the_middle_does_not_cost_the_next() -> None:
    reader = Socketcand()
    found = reader.feed(socketcand(1, b"a") + b"< frame 1600" + socketcand(2, b"b") + b"< ok >" + socketcand(3, b"c"))
    assert [frame.identifier for frame in found] == [1, 2, 3]
    assert reader.counters == {"bad_lines": 1, "foreign_frames": 1}


@pytest.mark.parametrize(
    ("line", "data"),
    [
        (b"D160000109" + b"00" * 12 + b"\r", bytes(12)),
        (b"B16000010F" + b"ab" * 64 + b"\r", b"\xab" * 64),
        (b"T160000102abcd1234\r", b"\xab\xcd"),
        (b"T160000100\r", b""),
    ],
)
def test_fd_frames_and_times_of_slcan_are_read(line: bytes, data: bytes) -> None:
    assert Slcan().feed(line) == [Frame(0x16000010, data, len(line))]


@pytest.mark.parametrize("line", [b"T160000109" + b"00" * 9, b"T160000102ab", b"D160000109ab", b"T1600", b"?"])
def test_a_length_that_contradicts_the_data_is_no_frame(line: bytes) -> None:
    reader = Slcan()
    assert reader.feed(line + b"\r") == []
    assert (reader.skipped, reader.counters) == (len(line) + 1, {"bad_lines": 1})
