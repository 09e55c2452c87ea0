"""Speed of the recording as ratios: each group holds the work and a rival; read the (x.x)."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.hours import SECONDS, record
from benchmarks.limit import spin
from gateway.recording import Recorder, Recording
from gateway.records import Raw, Record, Stamp
from gateway.reprocess.job import Job
from gateway.reprocess.work import work

RECORDS, BYTES = 20_000, 300
CHUNKS, CHUNK_BYTES = 100, 2350  # of a second of full buses: 622 radar words and 11,111 of ARINC 429, in 10 ms chunks
CORES = 2
TIMES_REAL = 1000.0
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


@pytest.mark.benchmark(group="writing down one second of full buses, each chunk on its own")
def test_writing_a_second_of_full_buses(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {})
    chunks = [Raw(k, Stamp(k, k), "bridge", RNG.bytes(CHUNK_BYTES)) for k in range(CHUNKS)]

    def write() -> None:
        for chunk in chunks:
            recorder.append([chunk])

    benchmark(write)


@pytest.mark.benchmark(group="writing down one second of full buses, each chunk on its own")
def test_limit_of_5_percent_of_a_core(benchmark: BenchmarkFixture) -> None:
    benchmark(spin, 0.05)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two minutes over terrain, the IRU's and the GNSS's bus full to the brim."""
    path = tmp_path_factory.mktemp("flight") / "flight.mcap"
    record(path)
    work(Job("flight", (path,)))  # compiles the kernels
    return path


@pytest.mark.benchmark(group="two recorded minutes, from disk to verdicts, on one core")
def test_two_recorded_minutes_to_verdicts(benchmark: BenchmarkFixture, flight: Path) -> None:
    assert len(benchmark(work, Job("flight", (flight,))).verdicts) > SECONDS / 5


@pytest.mark.benchmark(group="two recorded minutes, from disk to verdicts, on one core")
def test_limit_of_1000_times_real_time_on_two_cores(benchmark: BenchmarkFixture) -> None:
    benchmark(spin, CORES * SECONDS / TIMES_REAL)


@pytest.mark.benchmark(group="two recorded minutes, from disk to verdicts, on one core")
def test_a_plain_copy_of_the_file(benchmark: BenchmarkFixture, flight: Path, tmp_path: Path) -> None:
    benchmark(shutil.copyfile, flight, tmp_path / "copy")
