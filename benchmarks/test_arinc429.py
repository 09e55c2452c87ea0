"""ARINC 429 speed as ratios: each group holds the work and a named rival or limit; read the (x.x) of the median.

A limit is a wait of exactly the time that is allowed. The words are a full bus: every label of the set, all normal.
"""

import arinc429 as peer
import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.limit import spin
from decoders.arinc429 import decode, load_definitions, unpack
from decoders.definitions import Definitions
from simulators.arinc429 import encode_data

PEER_WORDS, WORDS, MANY = 1_000, 100_000, 10_000_000


@pytest.fixture(scope="module")
def definitions() -> Definitions:
    return load_definitions("iru_704")


@pytest.fixture(scope="module")
def words(definitions: Definitions) -> NDArray[np.uint32]:
    rng = np.random.default_rng(1)
    labels = rng.choice(list(definitions.labels), 1000)
    ssm = {label: 3 if row.ssm == "bnr" else 0 for label, row in definitions.labels.items()}
    one = [encode_data(int(x), [int(rng.integers(2**19))], ssm=ssm[int(x)])[0] for x in labels]
    return np.resize(np.array(one, np.uint32), MANY)


@pytest.mark.benchmark(group="429 unpack and decode: 100,000 words; PyPI arinc429: 1,000, so equal times are 100x")
def test_unpack_and_decode(benchmark: BenchmarkFixture, words: NDArray[np.uint32], definitions: Definitions) -> None:
    some = words[:WORDS]
    benchmark(lambda: (unpack(some), decode(some, definitions)))


@pytest.mark.benchmark(group="429 unpack and decode: 100,000 words; PyPI arinc429: 1,000, so equal times are 100x")
def test_peer(benchmark: BenchmarkFixture, words: NDArray[np.uint32]) -> None:
    some = words[:PEER_WORDS].tolist()

    def decode_each() -> None:
        decoder = peer.Decoder()
        for word in some:
            decoder.decode(word, encoding="BNR", scale=0.01)

    benchmark(decode_each)


@pytest.mark.benchmark(group="429 unpack and decode: 100,000 words against 20 million words a second")
def test_at_full_speed(benchmark: BenchmarkFixture, words: NDArray[np.uint32], definitions: Definitions) -> None:
    some = words[:WORDS]
    benchmark(lambda: (unpack(some), decode(some, definitions)))


@pytest.mark.benchmark(group="429 unpack and decode: 100,000 words against 20 million words a second")
def test_limit_of_20_million_words_a_second(benchmark: BenchmarkFixture) -> None:
    benchmark(lambda: spin(WORDS / 20e6))


@pytest.mark.benchmark(group="429 live: one call on a block against 30 us")
@pytest.mark.parametrize("size", [1, 10, 30])
def test_block(benchmark: BenchmarkFixture, words: NDArray[np.uint32], definitions: Definitions, size: int) -> None:
    block = words[:size].copy()
    benchmark(lambda: decode(block, definitions))


@pytest.mark.benchmark(group="429 live: one call on a block against 30 us")
def test_limit_of_30_us(benchmark: BenchmarkFixture) -> None:
    benchmark(lambda: spin(30e-6))


@pytest.mark.benchmark(group="429 decode: ten million words, by the size of a call", max_time=3)
@pytest.mark.parametrize("size", [1_000, 100_000, 10_000_000])
def test_linear(benchmark: BenchmarkFixture, words: NDArray[np.uint32], definitions: Definitions, size: int) -> None:
    parts = [words[start : start + size] for start in range(0, MANY, size)]

    def decode_parts() -> None:
        for part in parts:
            decode(part, definitions)

    benchmark(decode_parts)
