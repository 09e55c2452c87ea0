"""Speed as ratios: each group holds the work and a rival that does the least any program could; read the (x.x)."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from cobs import cobs
from numba import njit
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks import viewshed_speed
from benchmarks.limit import spin
from decoders import arinc708
from decoders.racklink import Framer
from monitor.geodesy import NM_M
from monitor.prediction import Beam, Pointing, predict
from monitor.shade import radar_states
from monitor.terrain import Grid, open_terrain, sample
from simulators import racklink
from simulators.scenario import BUILT_IN_TERRAIN

RADIALS, BINS, RANGE_NM = 361, 512, 10.0
RNG = np.random.default_rng(1)
PACKETS = 2000
LONG_ENOUGH_S = 5.0  # that some rounds of work that fills a core fall into moments when nobody else shares it


@pytest.fixture(scope="module")
def stream() -> bytes:
    """Radar words and blocks of ten ARINC 429 words in turn, as a bridge sends them."""
    packets = []
    for k in range(PACKETS):
        body = RNG.bytes(200)
        if k % 2:
            packets.append(racklink.encode(0x20, 0, k, k * 1000, struct.pack("<H", 1600) + body))
        else:
            packets.append(racklink.encode(0x10, 1, k, k * 1000, body[:80]))
    return b"".join(packets)


@pytest.mark.benchmark(group="framing, 2000 packets")
def test_framer(benchmark: BenchmarkFixture, stream: bytes) -> None:
    assert len(Framer().feed(stream)) == PACKETS  # loads what was compiled, or the first round is taken for long
    assert len(benchmark(lambda: Framer().feed(stream))) == PACKETS


@pytest.mark.benchmark(group="framing, 2000 packets")
def test_framing_by_a_bare_loop_over_cobs_and_crc(benchmark: BenchmarkFixture, stream: bytes) -> None:
    assert benchmark(lambda: _bare_loop([stream])) == PACKETS


@pytest.mark.benchmark(group="framing, 2000 packets in pieces of 4 KiB")
def test_framer_on_a_serial_line(benchmark: BenchmarkFixture, stream: bytes) -> None:
    pieces = _pieces(stream)

    def frame_all() -> int:
        framer = Framer()
        return sum(len(framer.feed(piece)) for piece in pieces)

    assert benchmark(frame_all) == PACKETS


@pytest.mark.benchmark(group="framing, 2000 packets in pieces of 4 KiB")
def test_framing_by_a_bare_loop_on_a_serial_line(benchmark: BenchmarkFixture, stream: bytes) -> None:
    pieces = _pieces(stream)
    assert benchmark(lambda: _bare_loop(pieces)) == PACKETS


def radar_words(count: int) -> NDArray[np.uint8]:
    return RNG.integers(0, 256, (count, 200), np.uint8)


@pytest.mark.benchmark(group="708 words to radials, 10000 words", max_time=LONG_ENOUGH_S)
def test_708_unpack(benchmark: BenchmarkFixture) -> None:
    words = radar_words(10_000)
    assert len(arinc708.unpack(words).bins) == len(words)
    assert benchmark(lambda: arinc708.unpack(words)).bins.shape == (10_000, BINS)


@pytest.mark.benchmark(group="708 words to radials, 10000 words", max_time=LONG_ENOUGH_S)
def test_copy_of_the_708_output(benchmark: BenchmarkFixture) -> None:
    radials = arinc708.unpack(radar_words(10_000))
    assert len(benchmark(lambda: [part.copy() for part in radials])) == len(radials)


@pytest.mark.benchmark(group="708 words to radials, 100000 words", max_time=LONG_ENOUGH_S)
def test_708_unpack_beyond_the_caches(benchmark: BenchmarkFixture) -> None:
    words = radar_words(100_000)
    assert benchmark(lambda: arinc708.unpack(words)).bins.shape == (100_000, BINS)


@pytest.mark.benchmark(group="708 words to radials, 100000 words", max_time=LONG_ENOUGH_S)
def test_copy_of_the_708_output_beyond_the_caches(benchmark: BenchmarkFixture) -> None:
    radials = arinc708.unpack(radar_words(100_000))
    assert len(benchmark(lambda: [part.copy() for part in radials])) == len(radials)


@pytest.mark.benchmark(group="708 headers, 100000 words")
def test_708_headers(benchmark: BenchmarkFixture) -> None:
    words = radar_words(100_000)
    assert len(benchmark(lambda: arinc708.headers(words)).label) == len(words)


@pytest.mark.benchmark(group="708 headers, 100000 words")
def test_limit_of_20_million_headers_a_second(benchmark: BenchmarkFixture) -> None:
    benchmark(lambda: spin(100_000 / 20e6))


@pytest.mark.benchmark(group="708 words of one packet or read, 30 words")
def test_708_unpack_live(benchmark: BenchmarkFixture) -> None:
    words = radar_words(30)
    assert len(arinc708.unpack(words).bins) == len(words)
    assert len(benchmark(lambda: arinc708.unpack(words)).bins) == len(words)


@pytest.mark.benchmark(group="708 words of one packet or read, 30 words")
def test_limit_of_30_us_a_call(benchmark: BenchmarkFixture) -> None:
    benchmark(lambda: spin(30e-6))


@pytest.fixture(scope="module")
def pointing() -> Pointing:
    ones = np.ones(RADIALS)
    azimuth = np.radians(197.6 + np.linspace(-90, 90, RADIALS))
    return Pointing(44.37514 * ones, -71.71874 * ones, 761.0 * ones, azimuth, np.radians(-2.0) * ones)


@pytest.fixture(scope="module")
def grid() -> Grid:
    return open_terrain(Path(BUILT_IN_TERRAIN["white_mountains"])).grid


@pytest.mark.benchmark(group="terrain thread of one scan, fan of seven")
def test_terrain_thread(benchmark: BenchmarkFixture, grid: Grid, pointing: Pointing) -> None:
    assert thread(grid, pointing, Beam()).shape == (RADIALS, BINS)  # compiles, or the first round is taken for long
    benchmark(lambda: thread(grid, pointing, Beam()))


@pytest.mark.benchmark(group="terrain thread of one scan, fan of seven")
def test_the_same_number_of_bilinear_looks(benchmark: BenchmarkFixture, grid: Grid) -> None:
    lat = latitudes(7 * RADIALS * BINS)
    assert _look(grid, lat, -71.7) > 0
    benchmark(lambda: _look(grid, lat, -71.7))


@pytest.mark.benchmark(group="terrain thread of one scan, boresight alone")
def test_terrain_thread_of_the_boresight(benchmark: BenchmarkFixture, grid: Grid, pointing: Pointing) -> None:
    beam = Beam(azimuth_fan=1)
    assert thread(grid, pointing, beam).shape == (RADIALS, BINS)
    benchmark(lambda: thread(grid, pointing, beam))


@pytest.mark.benchmark(group="terrain thread of one scan, boresight alone")
def test_one_bilinear_look_a_bin(benchmark: BenchmarkFixture, grid: Grid) -> None:
    lat = latitudes(RADIALS * BINS)
    assert _look(grid, lat, -71.7) > 0
    benchmark(lambda: _look(grid, lat, -71.7))


LINE_OF_SIGHT = "line of sight all round: the call at least 20 times as long, and 8 times without its start"


@pytest.mark.benchmark(group=LINE_OF_SIGHT)
def test_terrain_thread_all_round(benchmark: BenchmarkFixture) -> None:
    scan = viewshed_speed.scan()
    scan()
    benchmark(scan)


@pytest.mark.benchmark(group=LINE_OF_SIGHT)
@pytest.mark.parametrize("ground", viewshed_speed.GROUNDS_M)
def test_one_call_of_gdal_viewshed_on_the(benchmark: BenchmarkFixture, ground: str, tmp_path: Path) -> None:
    benchmark(viewshed_speed.call(tmp_path, ground))
    assert (tmp_path / "seen.tif").stat().st_size > 0


@pytest.mark.benchmark(group="radar thread of one scan")
def test_radar_thread(benchmark: BenchmarkFixture) -> None:
    bins = RNG.integers(0, 5, (RADIALS, BINS), np.uint8)
    assert benchmark(lambda: radar_states(bins)).shape == bins.shape


@pytest.mark.benchmark(group="radar thread of one scan")
def test_sum_of_the_bins(benchmark: BenchmarkFixture) -> None:
    bins = RNG.integers(0, 5, (RADIALS, BINS), np.uint8)
    assert _sum(bins) == bins.sum()
    benchmark(lambda: _sum(bins))


def thread(grid: Grid, pointing: Pointing, beam: Beam) -> NDArray[np.int8]:
    states, _ = predict(grid, pointing, BINS, RANGE_NM * NM_M / BINS, beam)
    return states


def latitudes(count: int) -> NDArray[np.float64]:
    """In order, so that neighbours lie close, as on a radial."""
    return np.sort(RNG.uniform(44.1, 44.6, count))


def _pieces(stream: bytes) -> list[bytes]:
    return [stream[at : at + 4096] for at in range(0, len(stream), 4096)]


def _bare_loop(pieces: list[bytes]) -> int:
    good, rest = 0, b""
    for piece in pieces:
        *runs, rest = (rest + piece).split(b"\0")
        for run in runs:
            packet = cobs.decode(run)
            good += zlib.crc32(packet[:-4]) == int.from_bytes(packet[-4:], "little")
    return good


@njit(cache=True)
def _look(grid: Grid, lat: NDArray[np.float64], lon: float) -> float:
    total = 0.0
    for k in range(lat.size):
        total += sample(grid, lat[k], lon)
    return total


@njit(cache=True)
def _sum(bins: NDArray[np.uint8]) -> int:
    total = 0
    for i in range(bins.shape[0]):
        for j in range(bins.shape[1]):
            total += bins[i, j]
    return total
