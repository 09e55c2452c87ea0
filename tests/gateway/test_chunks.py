"""Records as columns are the same records, however they come and are cut."""

import random
from pathlib import Path

import numpy as np
import pytest

from gateway.chunks import Block, Chunks, Run, blocks
from gateway.recording import Recorder, Recording
from gateway.records import Raw, Record, Stamp
from tests.gateway.made import raw, tick
from tests.gateway.test_batches import pipeline

CHOSEN = random.Random(7)


def records(count: int) -> list[Record]:
    """Chunks of three adapters and ticks, in any order."""
    return [
        raw(k, k / 10, CHOSEN.randbytes(CHOSEN.randrange(40)), CHOSEN.choice((0, 0, 3)), CHOSEN.choice(("a", "b", "c")))
        if CHOSEN.random() < 0.7
        else tick(k, k / 10)
        for k in range(count)
    ]


def listed(block: Block) -> list[Record]:
    """The records of a block as objects."""
    found: list[Record] = [*block.chunks]
    for others, (before, record) in enumerate(block.others):
        found.insert(before + others, record)
    return found


@pytest.mark.parametrize("count", [1, 2, 5, 60])
def test_a_block_has_the_records_it_was_made_of_in_their_order(count: int) -> None:
    for _ in range(20):
        some = records(count)
        cut = CHOSEN.randrange(count)
        raws = [record for record in some[cut:] if isinstance(record, Raw)]
        runs: list[Run] = [some[:cut], Chunks.of(raws) if raws else [], some[:1]]
        block, expected = Block.of(runs), [*some[:cut], *raws, some[0]]
        assert listed(block) == expected
        assert (block.first, block.last) == (expected[0], expected[-1])


def test_a_part_of_a_block_has_what_comes_between_its_chunks_and_on_both_sides() -> None:
    some = records(60)
    at = [k for k, record in enumerate(some) if isinstance(record, Raw)]
    for first in range(1, len(at) - 1):
        for end in range(first, len(at)):
            assert listed(Block.of([some]).part(first, end)) == some[at[first - 1] + 1 : at[end]]


def test_the_bytes_of_some_chunks_lie_one_behind_the_other() -> None:
    block = Block.of([records(60)])
    for name in ("a", "b", "c"):
        own = [k for k, record in enumerate(block.chunks) if record.adapter == name]
        data, ends = block.chunks.stream(np.array(own))
        chunks = [block.chunks.record(k).data for k in own]
        assert data.tobytes() == b"".join(chunks)
        assert ends.tolist() == [sum(map(len, chunks[: k + 1])) for k in range(len(chunks))]


def test_a_recording_gives_the_same_records_in_blocks_of_any_size(tmp_path: Path) -> None:
    some = records(300)
    recorder = Recorder(tmp_path / "a.mcap", {})
    recorder.append(some)
    recorder.close()
    recording = Recording(recorder.path)
    for size in (1, 7, 100, 1000):
        found = [*blocks(recording.runs(), size)]
        assert [record for block in found for record in listed(block)] == some
        assert all(len(listed(block)) >= size for block in found[:-1])
        assert recording.records == len(some)


def test_a_chunk_of_a_time_beyond_any_clock_is_taken_by_itself() -> None:
    far = Raw(1, Stamp(2**64 - 1, 2**64 - 1), "line", b"", 0)
    chunks = Block.of([[raw(0, 0, b"", adapter="line"), far, raw(2, 0, b"", adapter="line")]]).chunks
    assert pipeline(True).listener.alone(chunks) == [1]
    assert chunks.record(1) == far
