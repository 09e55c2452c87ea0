"""Datagrams: each is one packet or a counted loss, and bare radar words are timed by their arrival."""

import struct
import zlib

from hypothesis import given
from hypothesis import strategies as st

from decoders.datagrams import BareFramer, DatagramFramer
from decoders.framing import Packet, PacketFramer
from decoders.racklink import radar_word


def packet(body: bytes, sequence: int = 3) -> bytes:
    whole = struct.pack("<BBBBIQ", 1, 0x20, 4, 0, sequence, 77) + body
    return whole + struct.pack("<I", zlib.crc32(whole))


def chunk(*datagrams: bytes, arrival_ns: int = 5) -> bytes:
    return b"".join(struct.pack("<QH", arrival_ns, len(data)) + data for data in datagrams)


def check_books(framer: PacketFramer, size: int) -> None:
    assert framer.received == framer.framed + framer.skipped == size
    assert framer.pending == 0


def test_each_datagram_of_a_chunk_is_a_packet() -> None:
    framer, data = DatagramFramer(), chunk(packet(b"one"), packet(b"two", 4))
    assert framer.feed(data) == [Packet(0x20, 4, 0, 3, 77, b"one"), Packet(0x20, 4, 0, 4, 77, b"two")]
    check_books(framer, len(data))


@given(st.binary(max_size=5000))
def test_a_datagram_that_is_no_packet_is_a_counted_loss_and_costs_no_neighbour(noise: bytes) -> None:
    framer, data = DatagramFramer(), chunk(packet(b"one"), noise, packet(b"two"))
    assert [found.body for found in framer.feed(data)] == [b"one", b"two"]
    assert framer.bad_crc + framer.oversize == 1
    check_books(framer, len(data))


@given(st.binary(max_size=500))
def test_any_bytes_are_accounted_for(data: bytes) -> None:
    for framer in (DatagramFramer(), BareFramer()):
        framer.feed(data)
        check_books(framer, len(data))


def test_a_bare_datagram_is_a_radar_word_of_channel_0_at_the_time_of_its_arrival() -> None:
    framer, word = BareFramer(), bytes(range(200))
    first, short = framer.feed(chunk(word, word[:10], b"", arrival_ns=123))
    assert (first.type, first.channel, first.time_ns, radar_word(first)) == (0x20, 0, 123, (1600, word))
    assert radar_word(short) == (80, word[:10])
    assert short.sequence == first.sequence + 1
    assert framer.counters()["timed_by_arrival"] == 2
    assert framer.skipped == 10  # of the empty one


def test_a_successor_goes_on_with_the_counts() -> None:
    before, after = BareFramer(), BareFramer()
    before.feed(chunk(bytes(200)) + b"torn")
    after.succeed(before)
    assert after.counters() == before.counters()
