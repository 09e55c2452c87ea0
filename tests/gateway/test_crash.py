"""`kill -9` at any moment under full buses: what was accepted is in the recording, once, and replays as it was live.

20 moments here; `make crash` takes 200.
"""

import os
import random
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.full_load import Sender
from gateway.recording import Recording
from gateway.recording.recover import recover
from gateway.recording.verify import verify
from simulators.carriers import stream as stream_carrier
from simulators.outlets import PtyOutlet
from simulators.player import play
from tests.gateway.crashing import ACCEPTED, EVENTS, RECORDINGS, Nursery, nursery
from tests.gateway.live import recorded_bytes, replayed, wait_until

MOMENTS = int(os.environ.get("CRASH_MOMENTS", "20"))
SECONDS = 1.0  # of full load, at most


@pytest.fixture(scope="module")
def born() -> Iterator[Nursery]:
    with nursery() as made:
        yield made


@pytest.fixture(scope="module")
def load() -> list[tuple[int, bytes]]:
    """A radar and four ARINC 429 buses without a pause, as one bridge sends them."""
    sent = Sender(SECONDS).prepare(stream_carrier())
    return [(packet.ready_ns, unit) for packet in sent for unit in packet.units]


@pytest.mark.parametrize("seed", range(MOMENTS))
def test_a_killed_gateway_has_lost_no_word_that_it_accepted(
    born: Nursery, load: list[tuple[int, bytes]], tmp_path: Path, seed: int
) -> None:
    chance = random.Random(seed)
    stop = threading.Event()
    with PtyOutlet() as line:
        gateway = born.gateway(f"serial:{line.path}", tmp_path, rotate_mib=chance.choice([0, 0.02]))
        events = tmp_path / EVENTS
        wait_until(lambda: events.exists() and b'"UP"' in events.read_bytes(), "UP")
        sender = threading.Thread(target=play, args=(load, line), kwargs={"stop": stop})
        sender.start()
        time.sleep(chance.uniform(0.0, 0.9 * SECONDS))
        os.kill(gateway, signal.SIGKILL)
        assert born.ended() == str(int(signal.SIGKILL))
        stop.set()
        line.close()
        sender.join(20)
    accepted = int.from_bytes((tmp_path / ACCEPTED).read_bytes(), "little")
    printed = events.read_text()
    recording = Recording(tmp_path / RECORDINGS)
    kept = recorded_bytes(recording.files[0])
    assert b"".join(unit for _, unit in load).startswith(kept), "a word is doubled, or missing between others"
    assert len(kept) >= accepted
    again = "".join(text + "\n" for text in replayed(recording.files[0]))
    assert again.startswith(printed)
    found = verify(recording)
    assert found.missing == 0 and all("ends without its index" in text for text in found.problems)
    recover(recording, iter(recording), tmp_path / "whole.mcap")
    assert recorded_bytes(tmp_path / "whole.mcap") == kept
    assert verify(Recording(tmp_path / "whole.mcap")).problems == []


def test_moments_differ() -> None:
    assert len({random.Random(seed).uniform(0, 1) for seed in range(MOMENTS)}) == MOMENTS >= 20
