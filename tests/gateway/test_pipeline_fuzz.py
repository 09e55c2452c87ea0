"""Hostile input: no bytes and no packets, however they lie, make the pipeline raise."""

import json
from functools import partial

from hypothesis import given
from hypothesis import strategies as st

from decoders import formats as f
from gateway.config import check_config
from gateway.pipeline import Pipeline
from gateway.records import Raw, Record
from gateway.text import lines
from simulators import racklink
from tests.gateway.made import HELLO, raw, stamp, tick

CHANNELS = {"3": {"kind": "arinc429", "definitions": "wxr_panel"}}
RACK = check_config(
    {"adapters": [{"name": name, "source": "serial:x", "channels": CHANNELS} for name in ("a", "b")]}, "test"
)

TIMES = st.one_of(st.integers(0, 10**10), st.integers(0, 2**64 - 1), st.sampled_from([0, 2**62, 2**62 + 1, 2**63]))


def _word(bits: int, word: bytes) -> bytes:
    return racklink.word_708(word, bits)


BODIES = st.one_of(
    st.just(HELLO),
    st.binary(max_size=60),
    st.binary(min_size=200, max_size=200).map(lambda word: b"\x40\x06" + word),
    st.integers(0, 2048).flatmap(
        lambda n: st.binary(min_size=(n + 7) // 8, max_size=(n + 7) // 8).map(partial(_word, n))
    ),
    st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)), min_size=1, max_size=6).map(
        lambda pairs: racklink.words_429([k for k, _ in pairs], [word for _, word in pairs])
    ),
)
KINDS = st.sampled_from([f.HELLO, f.HEARTBEAT, f.TIME_MARK, f.WORDS_429, f.WORD_708, 0x77])
PACKETS = st.builds(
    racklink.encode, KINDS, st.integers(0, 3), st.integers(0, 2**32 - 1), TIMES, BODIES, flags=st.integers(0, 255)
)
CHUNKS = st.one_of(PACKETS, st.binary(max_size=40), st.just(racklink.encode(f.HELLO, 0, 0, 0, HELLO)))


@given(st.lists(st.tuples(st.sampled_from(["a", "b"]), st.integers(0, 10**11), CHUNKS), max_size=25))
def test_no_packet_makes_the_pipeline_raise_and_every_event_is_json(pieces: list[tuple[str, int, bytes]]) -> None:
    pipeline = Pipeline(RACK, None)
    records: list[Record] = [Raw(0, stamp(0), "a", racklink.encode(f.HELLO, 0, 0, 0, HELLO))]
    for k, (adapter, time_ns, chunk) in enumerate(pieces):
        records += [raw(2 * k + 1, time_ns / 1e9, chunk, adapter=adapter), tick(2 * k + 2, time_ns / 1e9)]
    events = [event for record in records for event in pipeline.feed(record)] + list(pipeline.finish())
    assert [json.loads(event.to_json())["type"] for event in events][-1] == "summary"
    assert sum(event.type == "state" for event in events) == len(pieces)


@given(st.lists(CHUNKS, max_size=15))
def test_no_packet_makes_the_dump_raise_and_every_word_is_one_line(chunks: list[bytes]) -> None:
    hello = racklink.encode(f.HELLO, 0, 0, 0, HELLO)
    found = list(lines([raw(k, k, chunk, adapter="a") for k, chunk in enumerate([hello, *chunks])], RACK))
    assert all(line.isprintable() for line in found)
