"""The framer keeps its books on any bytes."""

import sys
import tracemalloc
import zlib
from functools import cache
from itertools import pairwise
from subprocess import run

import numpy as np
import numpy.typing as npt
import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from decoders import layouts
from decoders.racklink import MOST_STARTS, Framer, Packet
from tests.decoders.bus import frame

LARGEST_RUN = 4096 + 17  # COBS adds a byte to each begun group of 254
BODIES = st.binary(max_size=600)
GARBAGE = st.lists(st.sampled_from([b"\0", b"\1", b"\xff" * 300, b"abc\0", b"\5ab\0", b"x" * 3000]), max_size=6)


def packet_bytes(body: bytes = b"", kind: int = 0x10, sequence: int = 0, version: int = 1) -> bytes:
    head = layouts.PACKET_HEADER.build(
        {"type": kind, "channel": 7, "flags": 0x12, "sequence": sequence, "time_ns": 2**40 + 5}
    )
    packet = bytes([version]) + head[1:] + body
    return packet + zlib.crc32(packet).to_bytes(4, "little")


GOOD = Packet(0x10, 7, 0x12, 3, 2**40 + 5, b"body")
GOOD_FRAME = frame(packet_bytes(b"body", sequence=3))
FALSE_START = b"\5\1abc"  # sound COBS that begins as a packet does: what a hostile sender would repeat


def fed(pieces: list[bytes]) -> tuple[list[Packet], dict[str, int]]:
    framer = Framer()
    packets = [packet for piece in pieces for packet in framer.feed(piece)]
    return packets, framer.counters()


def test_a_packet_comes_out_with_its_header_and_body() -> None:
    packets, counters = fed([GOOD_FRAME])
    assert packets == [GOOD]
    assert counters == dict.fromkeys(counters, 0) | {"received": len(GOOD_FRAME), "framed": len(GOOD_FRAME)}


def test_a_packet_written_out_byte_by_byte_decodes() -> None:
    # A time mark of channel 7 after a FIFO overflow; its one zero byte is the COBS code 05.
    stream = bytes.fromhex("18 0103070104030201 0807060504030201 11223344556677 05 9d220752 00")
    packets, _ = fed([stream])
    assert packets == [Packet(3, 7, 1, 0x01020304, 0x0102030405060708, bytes.fromhex("1122334455667700"))]


@given(st.lists(BODIES, max_size=5), GARBAGE, st.data())
def test_any_cut_of_the_stream_gives_the_same_packets_and_counters(
    bodies: list[bytes], garbage: list[bytes], data: st.DataObject
) -> None:
    stream = b"".join([frame(packet_bytes(body)) for body in bodies] + garbage + [GOOD_FRAME] + garbage)
    cuts = [0, *sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12))), len(stream)]
    assert fed([stream[a:b] for a, b in pairwise(cuts)]) == fed([stream])


@pytest.mark.parametrize("size", [*range(1, len(GOOD_FRAME) + 2), 100, 1000, 4096, LARGEST_RUN, LARGEST_RUN + 1])
def test_after_each_piece_of_any_size_the_outcome_is_that_of_the_bytes_so_far_at_once(size: int) -> None:
    stream, at_once = every_outcome()
    framer, packets = Framer(), 0
    for end in range(size, len(stream) + size, size):
        packets += len(framer.feed(stream[end - size : end]))
        assert (packets, framer.counters()) == at_once[min(end, len(stream))]


@cache
def every_outcome() -> tuple[bytes, list[tuple[int, dict[str, int]]]]:
    """A stream that meets every fault and every way out of one, and what each beginning of it gives."""
    damaged = GOOD_FRAME[:-3] + b"\xff" + GOOD_FRAME[-2:]
    parts = [GOOD_FRAME, b"\0\0", damaged, b"\xffab" + GOOD_FRAME, b"\x09abc\0", frame(packet_bytes(b"new", version=2))]
    parts += [frame(packet_bytes(bytes(4077))), b"\7" * 4200 + GOOD_FRAME, frame(b"short"), GOOD_FRAME, GOOD_FRAME[:9]]
    stream = b"".join(parts)
    outcomes = [fed([stream[:end]]) for end in range(len(stream) + 1)]
    return stream, [(len(packets), counters) for packets, counters in outcomes]


def test_the_stream_of_every_outcome_meets_every_counter() -> None:
    packets, counters = every_outcome()[1][-1]
    assert packets == 4
    assert all(counters.values())


def joined(chunks: list[bytes]) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Chunks one behind the other, and where each ends."""
    return np.frombuffer(b"".join(chunks), np.uint8), np.cumsum([len(chunk) for chunk in chunks])


@given(st.lists(BODIES, max_size=5), GARBAGE, st.data())
def test_chunks_framed_many_at_once_are_those_framed_one_by_one(
    bodies: list[bytes], garbage: list[bytes], data: st.DataObject
) -> None:
    stream = b"".join([frame(packet_bytes(body)) for body in bodies] + garbage + [GOOD_FRAME] + garbage)
    cuts = [0, *sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12))), len(stream)]
    pieces = [stream[a:b] for a, b in pairwise(cuts)]
    one_by_one, at_once = Framer(), Framer()
    fed = [(k, packet) for k, piece in enumerate(pieces) for packet in one_by_one.feed(piece)]
    framed = at_once.frame(*joined(pieces))
    found = [(int(framed.chunk[k]), framed.packet(k)) for k in range(len(framed.header))]
    assert (found, at_once.counters()) == (fed, one_by_one.counters())


@pytest.mark.parametrize("size", [253, 254, 255, 507, 508, 509, 2000])
def test_runs_without_a_zero_of_any_length_lose_their_cobs_in_the_compiled_loop(
    size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(Framer, "_close")  # which takes what that loop leaves
    body = bytes(1 + k % 255 for k in range(size))
    for sent in (body, b"\0" + body, body + b"\0", body[:-1] + b"\0" + body):
        packets, _ = fed([frame(packet_bytes(sent, sequence=3)), GOOD_FRAME])
        assert packets == [GOOD._replace(body=sent), GOOD]


def test_an_empty_group_behind_a_full_one_stands_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(Framer, "_close")
    # 254 bytes before the end: some encoders close the full group, 0xff, with a code of its own for no bytes.
    packet = next(p for k in range(256) if 0 not in (p := _without_zero(k)))
    run = b"\xff" + packet
    assert cobs.decode(run) == cobs.decode(run + b"\1") == packet
    framer = Framer()
    assert [found.body for found in framer.feed(run + b"\0" + run + b"\1\0")] == [packet[16:-4]] * 2


def _without_zero(k: int) -> bytes:
    """A packet of 254 bytes that has no zero but perhaps in its CRC."""
    packet = b"\1\x10\7\x12" + bytes([1, 1, 1, 1, *8 * [1]]) + bytes(233 * [7]) + bytes([k or 1])
    return packet + zlib.crc32(packet).to_bytes(4, "little")


@pytest.mark.parametrize("chunks", [[b"\0"], [b"", b"", b"\0"], [b"", b"\0" + GOOD_FRAME]])
def test_a_packet_at_the_end_of_an_overlong_run_comes_with_the_chunk_that_closes_it(chunks: list[bytes]) -> None:
    large = GOOD._replace(body=bytes(range(256)) * 15)
    began = b"\xaa" * 9000 + frame(packet_bytes(large.body, sequence=3))[:-1]
    many, single = Framer(), Framer()
    many.frame(*joined([began]))
    single.feed(began)
    found, expected = (
        many.frame(*joined(chunks)),
        [(p, k) for k, chunk in enumerate(chunks) for p in single.feed(chunk)],
    )
    assert [(found.packet(k), found.chunk[k]) for k in range(len(found.header))] == expected
    assert many.counters() == single.counters()
    assert many.counters()["oversize"] == 1 and expected[0][0] == large


@given(st.lists(BODIES, max_size=2), GARBAGE)
def test_one_byte_at_a_time_gives_the_same_packets_and_counters(bodies: list[bytes], garbage: list[bytes]) -> None:
    stream = b"".join([frame(packet_bytes(body)) for body in bodies] + garbage + [GOOD_FRAME])
    assert fed([bytes([byte]) for byte in stream]) == fed([stream])


@given(st.one_of(st.binary(max_size=9000), GARBAGE.map(b"".join)))
def test_after_any_garbage_the_next_good_packet_decodes(garbage: bytes) -> None:
    packets, _ = fed([garbage, GOOD_FRAME])
    assert packets[-1] == GOOD


@pytest.mark.parametrize("length", range(1, len(GOOD_FRAME)))
def test_a_packet_cut_short_does_not_take_its_neighbour_with_it(length: int) -> None:
    packets, counters = fed([GOOD_FRAME[:length], GOOD_FRAME])
    assert packets == [GOOD]
    assert (counters["skipped"], counters["framed"]) == (length, len(GOOD_FRAME))
    assert counters["bad_crc"] + counters["bad_cobs"] == 1


@given(st.lists(st.one_of(st.binary(max_size=9000), GARBAGE.map(b"".join)), max_size=4))
def test_every_byte_is_framed_skipped_or_pending_and_pending_is_bounded(pieces: list[bytes]) -> None:
    framer = Framer()
    for piece in pieces:
        framer.feed(piece)
        assert framer.received == framer.framed + framer.skipped + framer.pending
        assert framer.pending <= LARGEST_RUN
    assert framer.received == sum(map(len, pieces))


@pytest.mark.parametrize("place", range(len(GOOD_FRAME) - 1))
def test_a_damaged_packet_costs_itself_alone_and_one_count(place: int) -> None:
    damaged = bytearray(GOOD_FRAME)
    damaged[place] ^= 0xFF if damaged[place] != 0xFF else 0x01
    packets, counters = fed([bytes(damaged) + GOOD_FRAME])
    assert packets == [GOOD]
    assert counters["skipped"] == counters["framed"] == len(GOOD_FRAME)
    assert counters["bad_crc"] + counters["bad_cobs"] == 1


def test_a_bad_crc_is_counted() -> None:
    _, counters = fed([frame(packet_bytes(b"body")[:-1] + b"\0")])
    assert (counters["bad_crc"], counters["framed"]) == (1, 0)


def test_a_packet_too_short_for_header_and_crc_is_counted_as_a_bad_crc() -> None:
    short = [head + zlib.crc32(head).to_bytes(4, "little") for head in (b"", bytes(15), b"\1", b"\1" + bytes(14))]
    for packet in (b"", b"\1", *short):
        assert fed([frame(packet)])[1]["bad_crc"] == 1


def test_a_cobs_code_that_points_past_the_end_is_counted() -> None:
    packets, counters = fed([b"\x09abc\0" + GOOD_FRAME])
    assert (packets, counters["bad_cobs"], counters["skipped"]) == ([GOOD], 1, 5)


def test_the_largest_packet_passes_and_one_byte_more_is_oversize() -> None:
    for fill in (b"\0", b"\7"):
        packets, counters = fed([frame(packet_bytes(fill * 4076))])
        assert (len(packets), counters["oversize"]) == (1, 0)
        packets, counters = fed([frame(packet_bytes(fill * 4077)) + GOOD_FRAME])
        assert (packets, counters["oversize"]) == ([GOOD], 1)


def test_the_largest_packet_is_the_longest_run_that_is_kept() -> None:
    assert len(cobs.encode(packet_bytes(b"\7" * 4076))) == LARGEST_RUN
    framer = Framer()
    framer.feed(b"\7" * LARGEST_RUN)
    assert (framer.pending, framer.oversize) == (LARGEST_RUN, 0)
    framer.feed(b"\7")
    assert (framer.pending, framer.oversize, framer.skipped) == (LARGEST_RUN, 1, 1)


def test_an_overlong_run_is_one_count_and_costs_no_good_packet() -> None:
    packets, counters = fed([b"\7" * 5000, b"\7" * 5000, GOOD_FRAME, GOOD_FRAME])
    assert (packets, counters["oversize"]) == ([GOOD, GOOD], 1)
    assert counters["skipped"] == 10_000


@pytest.mark.parametrize("piece", [1, 4096, 1 << 20])
@pytest.mark.parametrize("repeats", [LARGEST_RUN // len(FALSE_START), 10_000])
def test_a_run_full_of_false_starts_costs_a_bounded_number_of_attempts(
    monkeypatch: pytest.MonkeyPatch, repeats: int, piece: int
) -> None:
    attempts: list[int] = []
    decode = cobs.decode

    def counted(run: bytes) -> bytes:
        attempts.append(len(run))
        return bytes(decode(run))

    monkeypatch.setattr(cobs, "decode", counted)
    run = FALSE_START * repeats + b"\0"
    _, counters = fed([run[at : at + piece] for at in range(0, len(run), piece)])
    assert MOST_STARTS <= len(attempts) <= MOST_STARTS + 2
    assert sum(size > LARGEST_RUN for size in attempts) <= 1
    assert (counters["skipped"], counters["bad_crc"] + counters["oversize"]) == (len(run), 1)


def test_a_packet_behind_any_number_of_false_starts_is_found() -> None:
    for many in (1, MOST_STARTS, 3 * MOST_STARTS, 10_000):
        packets, counters = fed([FALSE_START * many + GOOD_FRAME])
        assert (packets, counters["skipped"]) == ([GOOD], len(FALSE_START) * many)


def test_a_packet_that_holds_as_many_false_starts_as_are_tried_is_lost_behind_garbage_and_costs_no_other() -> None:
    body = b"\5\1" * (MOST_STARTS + 1)
    assert len(fed([frame(packet_bytes(body))])[0]) == 1
    run = b"garbage" + frame(packet_bytes(body))
    packets, counters = fed([run + GOOD_FRAME])
    assert (packets, counters["skipped"], counters["bad_crc"] + counters["bad_cobs"]) == ([GOOD], len(run), 1)


@pytest.mark.parametrize("endless", [b"\7", FALSE_START, b"\xff\1", b"\0"])
def test_memory_stays_bounded_whatever_comes(endless: bytes) -> None:
    framer, piece = Framer(), endless * (4096 // len(endless))
    framer.feed(piece * 2)
    tracemalloc.start()
    for _ in range(50):
        framer.feed(piece)
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept < 4 * LARGEST_RUN
    assert peak < 100_000


def test_another_version_is_intact_and_counted_but_no_packet() -> None:
    data = frame(packet_bytes(b"new", version=2))
    packets, counters = fed([data])
    assert (packets, counters["unknown_version"], counters["framed"]) == ([], 1, len(data))


def test_an_unknown_type_is_a_packet() -> None:
    assert fed([frame(packet_bytes(b"?", kind=0xEE))])[0][0].type == 0xEE


def test_zeros_between_packets_are_skipped_and_nothing_else() -> None:
    packets, counters = fed([b"\0\0" + GOOD_FRAME + b"\0"])
    assert packets == [GOOD]
    assert counters["skipped"] == 3
    assert not any(counters[name] for name in ("bad_crc", "bad_cobs", "oversize", "unknown_version"))


def test_importing_the_framer_does_not_import_construct() -> None:
    code = "import decoders.racklink, sys; sys.exit('construct' in sys.modules)"
    assert run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_successor_keeps_the_books_and_counts_what_was_pending_as_skipped() -> None:
    before, after = Framer(), Framer()
    before.feed(GOOD_FRAME + b"\7\7\7")
    after.succeed(before)
    assert after.feed(GOOD_FRAME) == [GOOD]
    assert after.counters() == fed([GOOD_FRAME])[1] | {
        "received": 2 * len(GOOD_FRAME) + 3,
        "framed": 2 * len(GOOD_FRAME),
        "skipped": 3,
    }
