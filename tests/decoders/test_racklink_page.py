"""The test vectors that bridge makers read decode as the page says: with our decoders, and without them."""

import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from cobs import cobs

from decoders.can_frames import Recorded
from decoders.datagrams import DatagramFramer
from decoders.racklink import (
    ChannelCount,
    Framer,
    HelloChannel,
    Packet,
    heartbeat,
    hello,
    radar_word,
    time_mark,
    words429,
)
from decoders.racklink_can import CanFramer

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "racklink.md").read_text(encoding="utf-8")
PACKETS = ("hello", "words", "radar", "heartbeat")
WORD_708 = bytes.fromhex("b443047a0e80767c" + 64 * "88c6fa")
BINS = [*range(8)] * 64
RECORD = struct.pack("<QHB", 1_502_000_000, 1600, 0) + WORD_708  # of the radar word, as CAN carries it


def block(name: str) -> str:
    found = re.search(rf"```{name}\n(.+?)\n```", PAGE, re.DOTALL)
    assert found is not None, name
    return found[1]


def frame(name: str) -> bytes:
    return bytes.fromhex(block(name))


def packet(name: str) -> Packet:
    (found,) = Framer().feed(frame(name))
    return found


def can_frames(name: str) -> list[tuple[int, bytes]]:
    """Identifier and data of each line."""
    lines = [re.fullmatch(r"([0-9A-F]{8})#(?:#1)?((?:[0-9A-F]{2})+)", line) for line in block(name).splitlines()]
    return [(int(line[1], 16), bytes.fromhex(line[2])) for line in lines if line]


def can_fields(identifier: int) -> tuple[int, int, int, int]:
    """Prefix, channel, kind and index, from the bits written out."""
    bits = f"{identifier:029b}"
    return int(bits[:5], 2), int(bits[5:13], 2), int(bits[13:17], 2), int(bits[17:], 2)


def test_the_hello_names_the_bridge_and_its_channels() -> None:
    said = hello(packet("hello"))
    assert (said.serial_number, said.firmware) == (0x1234, 0x0102)
    assert said.channels == (HelloChannel(0, 0x70, 0, 0), HelloChannel(1, 0x2A, 0, 4))


def test_the_words_come_with_their_times() -> None:
    said = packet("words")
    words = words429(said)
    assert (said.channel, said.sequence, said.flags) == (1, 1, 0x01)
    assert words.words.tolist() == [0x600C808B, 0xE00190A1]
    assert words.time_ns.tolist() == [1_500_000_000, 1_500_360_000]


def test_the_radar_word_has_the_header_and_the_bins_of_the_page() -> None:
    said = packet("radar")
    assert (said.channel, said.sequence, said.time_ns) == (0, 2, 1_502_000_000)
    assert radar_word(said) == (1600, WORD_708)
    bits = "".join(f"{byte:08b}"[::-1] for byte in WORD_708)
    assert [int(bits[at : at + 3][::-1], 2) for at in range(64, 1600, 3)] == BINS


def test_the_heartbeat_counts_the_words_before_it() -> None:
    said = packet("heartbeat")
    assert (said.sequence, said.time_ns) == (3, 2_000_000_000)
    assert heartbeat(said) == (ChannelCount(0, 1, 0), ChannelCount(1, 2, 2))


def test_the_time_mark_is_older_than_its_packet() -> None:
    said = packet("mark")
    assert (time_mark(said), said.time_ns) == (3_000_000_000, 3_001_000_000)


@pytest.mark.parametrize(("number", "name"), [*enumerate((*PACKETS, "mark"))])
def test_each_packet_reads_the_same_without_our_decoders(number: int, name: str) -> None:
    whole = frame(name)
    assert whole.index(0) == len(whole) - 1
    plain = cobs.decode(whole[:-1])
    assert struct.unpack("<I", plain[-4:]) == (zlib.crc32(plain[:-4]),)
    version, kind, channel, flags, sequence, time_ns = struct.unpack_from("<BBBBIQ", plain)
    assert (version, sequence) == (1, number)
    assert Packet(kind, channel, flags, sequence, time_ns, plain[16:-4]) == packet(name)


def test_the_datagram_is_the_heartbeat_without_cobs() -> None:
    assert frame("datagram") == cobs.decode(frame("heartbeat")[:-1])


def test_the_senders_write_the_packets_of_the_page() -> None:
    sender = ROOT / "examples" / "sender" / "sender.py"
    sent = subprocess.run([sys.executable, "-I", "-S", sender], capture_output=True, check=True).stdout
    assert sent == b"".join(frame(name) for name in PACKETS)


def test_our_decoders_take_the_datagram_for_the_heartbeat() -> None:
    datagram = frame("datagram")
    assert DatagramFramer().feed(struct.pack("<QH", 0, len(datagram)) + datagram) == [packet("heartbeat")]


def test_our_decoders_make_packets_of_the_can_frames() -> None:
    lines = [line for name in ("can429", "canfd708", "canheartbeat") for line in can_frames(name)]
    chunk = b"".join(struct.pack("<QIBB", 0, 1 << 31 | number, 0, len(data)) + data for number, data in lines)
    framer = CanFramer(Recorded())
    said = {one.type: one for one in framer.feed(chunk)}
    assert words429(said[0x10]).words.tolist() == [0x600C808B]
    assert radar_word(said[0x20]) == (1600, WORD_708)
    assert said[0x20].time_ns - said[0x10].time_ns == 2_000_000
    assert heartbeat(said[0x02]) == (ChannelCount(1, 2, 2),)
    assert [said[kind].channel for kind in (0x10, 0x20, 0x02)] == [1, 0, 1]
    assert framer.framed == framer.received


def test_the_can_frame_of_an_arinc_429_word_has_its_low_byte_in_the_identifier() -> None:
    ((identifier, data),) = can_frames("can429")
    assert can_fields(identifier) == (0b10110, 1, 0, 0x8B)
    assert struct.unpack("<II", data) == (0x600C808B, 1_500_000)


def test_the_classic_frames_carry_seven_bytes_of_the_radar_word_each() -> None:
    frames = can_frames("can708")
    assert [can_fields(identifier) for identifier, _ in frames] == [(0b10110, 0, 1, k) for k in (0, 1, 30)]
    assert [data for _, data in frames] == [b"\5" + RECORD[7 * k : 7 * k + 7] for k in (0, 1, 30)]
    assert len(RECORD) == 30 * 7 + 1


def test_the_fd_frames_carry_the_whole_radar_word_and_zeros_up_to_a_length_that_fd_has() -> None:
    frames = can_frames("canfd708")
    assert [can_fields(identifier) for identifier, _ in frames] == [(0b10110, 0, 1, k) for k in range(4)]
    assert [data[0] for _, data in frames] == [5] * 4
    assert b"".join(data[1:] for _, data in frames) == RECORD + b"\0"
    assert [len(data) for _, data in frames] == [64, 64, 64, 24]


def test_the_can_heartbeat_counts_one_channel() -> None:
    ((identifier, data),) = can_frames("canheartbeat")
    assert can_fields(identifier) == (0b10110, 1, 2, 0)
    assert struct.unpack("<II", data) == (2, 2)


def test_every_can_line_is_a_frame() -> None:
    names = ("can429", "can708", "canfd708", "canheartbeat")
    assert [len(can_frames(name)) for name in names] == [len(block(name).splitlines()) for name in names]
