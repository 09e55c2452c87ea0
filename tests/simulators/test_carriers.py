"""What goes down each kind of line, against bytes worked out by hand and by other people's readers."""

import struct
import zlib

import can
import pytest
from can.interfaces.slcan import slcanBus
from cobs import cobs

from simulators import carriers
from simulators.carriers import Carrier, Frame, Unit
from simulators.outlets import SlcanOutlet
from simulators.racklink import Packet

WORDS = Packet(0x10, 1, 0, 2, 1_500_000_000, bytes.fromhex("00000000 8b800c60  407e0500 a19001e0"))
HEARTBEAT = Packet(0x02, 0, 0, 3, 0, bytes.fromhex("00 50000000 00000000  01 90010000 02000000"))
HELLO = Packet(0x01, 0, 0, 4, 0, bytes(6))
RADAR_WORD = bytes(range(1, 201))
HEAD = bytes.fromhex("8877665544332211 4006 08")  # u64 time, u16 1600 bits, flags


def radar(channel: int = 0, word: bytes = RADAR_WORD) -> Packet:
    return Packet(0x20, channel, 0x08, 5, 0x1122334455667788, struct.pack("<H", 8 * len(word)) + word)


def sent(carrier: Carrier[Unit], *packets: Packet) -> list[Unit]:
    return [unit for packet in packets for unit in carrier.units(packet)]


PACKED = bytes.fromhex("01 10 01 00 02000000 002f685900000000 00000000 8b800c60 407e0500 a19001e0")


def test_a_stream_carries_a_packet_as_one_cobs_frame_with_its_zero_byte() -> None:
    (frame,) = sent(carriers.stream(), WORDS)
    assert frame[-1:] == b"\0"
    assert cobs.decode(frame[:-1]) == PACKED + struct.pack("<I", zlib.crc32(PACKED))


def test_a_datagram_is_the_packet_with_its_crc_and_nothing_else() -> None:
    assert sent(carriers.datagram(), WORDS) == [PACKED + struct.pack("<I", zlib.crc32(PACKED))]


@pytest.mark.parametrize("fd", [False, True])
def test_on_can_each_arinc_429_word_is_a_frame_with_its_own_time_in_microseconds(fd: bool) -> None:
    assert sent(carriers.can(fd), WORDS) == [
        Frame(0x1601008B, bytes.fromhex("8b800c60 60e31600"), fd),
        Frame(0x160100A1, bytes.fromhex("a19001e0 c8e41600"), fd),
    ]


def test_the_time_of_a_word_on_can_keeps_its_low_32_bits() -> None:
    late = WORDS._replace(time_ns=(2**32 + 7) * 1000)
    assert sent(carriers.can(), late)[0].data[4:] == bytes.fromhex("07000000")


def test_on_can_a_heartbeat_is_a_frame_a_channel() -> None:
    assert sent(carriers.can(), HEARTBEAT) == [
        Frame(0x16002000, bytes.fromhex("50000000 00000000"), False),
        Frame(0x16012000, bytes.fromhex("90010000 02000000"), False),
    ]


def test_a_hello_has_no_form_on_can() -> None:
    assert sent(carriers.can(), HELLO) == []


def test_on_classic_can_a_radar_word_is_cut_into_segments_of_seven_bytes_behind_the_counter() -> None:
    frames = sent(carriers.can(), radar(channel=3))
    assert [frame.id for frame in frames] == [0x16031000 + index for index in range(31)]
    assert frames[0] == Frame(0x16031000, bytes.fromhex("00 88776655443322"), False)
    assert frames[1] == Frame(0x16031001, bytes.fromhex("00 114006 08 010203"), False)
    assert frames[30] == Frame(0x1603101E, b"\0" + RADAR_WORD[-1:], False)  # 11 + 200 = 30 * 7 + 1
    assert b"".join(frame.data[1:] for frame in frames) == HEAD + RADAR_WORD


def test_on_can_fd_a_radar_word_takes_four_frames_and_the_last_is_padded_to_a_length_that_exists() -> None:
    frames = sent(carriers.can(fd=True), radar())
    assert [len(frame.data) for frame in frames] == [64, 64, 64, 24]  # 11 + 200 = 3 * 63 + 22: 23 with the counter
    assert frames[3].data == b"\0" + RADAR_WORD[-22:] + b"\0"
    assert b"".join(frame.data[1:] for frame in frames)[:-1] == HEAD + RADAR_WORD
    assert all(frame.fd for frame in frames)


def test_radar_words_are_counted_for_each_channel_and_the_count_wraps() -> None:
    carrier = carriers.can(fd=True)
    counts = [carrier.units(radar(channel))[0].data[0] for channel in [0] * 257 + [3]]
    assert counts == [*range(256), 0, 0]


def test_a_short_radar_word_says_its_bits() -> None:
    packet = Packet(0x20, 0, 0x08, 0, 1, struct.pack("<H", 11) + b"\xff\x07")
    (frame,) = sent(carriers.can(fd=True), packet)
    assert frame.data == bytes.fromhex("00 0100000000000000 0b00 08 ff07 0000")


@pytest.mark.parametrize(
    ("fd", "lines"),
    [
        (False, b"T1600200085000000000000000\rT1601200089001000002000000\r"),
        (True, b"B1600200085000000000000000\rB1601200089001000002000000\r"),
    ],
)
def test_slcan_is_a_line_of_text_for_each_frame(fd: bool, lines: bytes) -> None:
    assert b"".join(sent(carriers.slcan(fd), HEARTBEAT)) == lines


def test_an_slcan_line_gives_the_length_of_an_fd_frame_by_its_code() -> None:
    assert [line[9:10] for line in sent(carriers.slcan(fd=True), radar())] == [b"F", b"F", b"F", b"C"]


@pytest.mark.parametrize("fd", [False, True])
def test_python_can_reads_our_slcan_lines_as_the_frames_that_they_stand_for(fd: bool) -> None:
    packets = [WORDS, radar(), HEARTBEAT]
    frames = sent(carriers.can(fd), *packets)
    with SlcanOutlet() as outlet:
        bus = slcanBus(outlet.path, sleep_after_open=0, bitrate=500_000)
        for line in sent(carriers.slcan(fd), *packets):
            outlet.write(line)
        heard = [bus.recv(5) for _ in frames]
        bus.shutdown()
    assert [read(message) for message in heard] == frames


def read(message: can.Message | None) -> Frame:
    assert message is not None
    assert message.is_extended_id
    return Frame(message.arbitration_id, bytes(message.data), message.is_fd)
