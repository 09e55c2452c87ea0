"""A power cut costs what the disk was not yet asked to hold, and nothing before it; the reader says where it ends."""

import os
import random
import time
from pathlib import Path

import pytest

from gateway.journal import now
from gateway.recording import Recorder, Recording
from gateway.recording.keeper import Keeper
from gateway.records import Raw, Record
from tests.gateway.made import raw, tick
from tests.gateway.recording.test_keeper import Bench

PAGE = 4096
INTERVAL = 100  # records between two synchronisations: a second of chunks each 10 ms


class Disk:
    """Notes how long a file was when the disk was last asked to hold it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.held: dict[int, int] = {}  # by inode
        truly = os.fdatasync

        def fdatasync(file: int) -> None:
            size = os.fstat(file).st_size
            truly(file)
            self.held[os.fstat(file).st_ino] = size

        monkeypatch.setattr(os, "fdatasync", fdatasync)

    def after_the_cut(self, path: Path, chance: random.Random) -> bytes:
        """What may be found: each page behind the held bytes is as written, as before, or full of something."""
        data = path.read_bytes()
        held = self.held.get(path.stat().st_ino, 0)
        left = bytearray(data[: chance.randrange(held, len(data) + 1)])
        for page in range(held - held % PAGE, len(left), PAGE):
            begin, end = max(page, held), min(page + PAGE, len(left))
            left[begin:end] = chance.choice([left[begin:end], bytes(end - begin), chance.randbytes(end - begin)])
        return bytes(left)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


@pytest.mark.parametrize("seed", range(40))
def test_a_power_cut_costs_an_interval_at_most(tmp_path: Path, disk: Disk, seed: int) -> None:
    chance = random.Random(seed)
    recorder = Recorder(tmp_path / "a.mcap", {"configuration": "{}"})
    recorder.sync()
    written: list[Record] = []
    held = 0
    for k in range(chance.randrange(1, 450)):
        record: Record = tick(k, k / 100) if k % INTERVAL == 50 else raw(k, k / 100, chance.randbytes(100))
        recorder.append([record])
        written.append(record)
        if k % INTERVAL == INTERVAL - 1:
            recorder.sync()
            held = len(written)
    left = disk.after_the_cut(recorder.path, chance)
    recorder.abandon()
    (tmp_path / "left.mcap").write_bytes(left)
    recording = Recording(tmp_path / "left.mcap")
    found = list(recording)
    assert found[:held] == written[:held]
    rest = iter(written[held:])
    assert all(record in rest for record in found[held:])
    assert len(written) - held < INTERVAL
    assert recording.torn
    if found:
        assert f"after {len(found)} records, the last one of 2026-05-28 20:26:4" in recording.torn


def test_what_the_figures_say_is_what_a_power_cut_costs_at_most(tmp_path: Path, disk: Disk) -> None:
    b = Bench(tmp_path, sync_interval_s=0.05)
    b.keeper.begin()
    kept: list[Record] = []
    for k in range(60):
        kept.append(Raw(k, now(), "bridge", bytes(500)))
        b.keeper.keep(kept[-1:])
        time.sleep(0.005)
    cut_ns = now().monotonic_ns
    left = disk.after_the_cut(b.keeper.path, random.Random(1))
    exposed_ns = longest_exposed_ns(b.keeper, cut_ns)
    b.keeper.end()
    (tmp_path / "left.mcap").write_bytes(left)
    found = {record.sequence for record in Recording(tmp_path / "left.mcap")}
    lost = [record for record in kept if record.sequence not in found]
    assert len(lost) < 60
    assert all(cut_ns - record.stamp.monotonic_ns <= exposed_ns for record in lost)


def longest_exposed_ns(keeper: Keeper, cut_ns: int) -> int:
    """The figure, had the cut come as the end of a synchronisation."""
    syncer = keeper._syncer
    (safe_until_ns,) = syncer._safe_until_ns.values()
    return max(syncer.figures.longest_exposed_ns, cut_ns - safe_until_ns)
