"""Speed of the recording as ratios: each group holds the work and a rival; read the (x.x)."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.limit import spin
from gateway.recording import Recorder, Recording
from gateway.records import Raw, Record, Stamp

RECORDS, BYTES = 20_000, 300
RNG = np.random.default_rng(1)


def records() -> list[Record]:
    return [Raw(k, Stamp(k * 1000, 10**18 + k * 1000), "bridge", RNG.bytes(BYTES)) for k in range(RECORDS)]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of small chunks."""
    recorder = Recorder(tmp_path_factory.mktemp("recording") / "a.mcap", {})
    recorder.append(records())
    recorder.close()
    return recorder.path


def read(path: Path) -> int:
    return sum(1 for _ in Recording(path))


@pytest.mark.benchmark(group="reading 20,000 records of 300 bytes")
def test_reading_and_checking(benchmark: BenchmarkFixture, path: Path) -> None:
    assert benchmark(read, path) == RECORDS


@pytest.mark.benchmark(group="reading 20,000 records of 300 bytes")
def test_limit_of_2_us_a_record(benchmark: BenchmarkFixture) -> None:
    benchmark(spin, RECORDS * 2e-6)


@pytest.mark.benchmark(group="reading 20,000 records of 300 bytes")
def test_the_mcap_library_without_checking(benchmark: BenchmarkFixture, path: Path) -> None:
    def messages() -> int:
        with path.open("rb") as file:
            return sum(1 for _ in NonSeekingReader(file).iter_messages(log_time_order=False))

    assert benchmark(messages) == RECORDS
