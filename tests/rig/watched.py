"""A source under its supervisor, as in the gateway, and all that came of it."""

import struct
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from decoders import formats as f
from decoders.profiles import load_profile
from gateway.adapters import Reading, make_adapter
from gateway.config import AdapterConfig
from gateway.link import Link
from gateway.supervision import Supervisor
from tests.rig.words import Frame

DEADLINE_S = 20.0  # of an emulated machine on a busy host


def wait_until(condition: Callable[[], object], what: Callable[[], str]) -> None:
    """Return as soon as the condition holds; fail after the deadline and say what there is instead."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline, what()
        time.sleep(0.01)


class Watched:
    """Reads its source inside a `with` block."""

    def __init__(self, source: str) -> None:
        config = AdapterConfig(name="bridge", source=source)
        self.link = Link(config, load_profile("arinc708"))
        self.states: list[str] = []
        self.reasons: list[str] = []
        self.sequences: list[int] = []
        self.words: list[int] = []
        self.radar_words: list[bytes] = []
        self.recorded = b""
        self.lost = 0
        self._supervisor = Supervisor(config.name, make_adapter(config), self._take, self._say)
        self._thread = threading.Thread(target=self._supervisor.run, daemon=True)

    def wait_up(self, times: int = 1) -> None:
        """Until the line was opened so many times."""
        wait_until(lambda: self.states.count("UP") >= times, lambda: f"not up {times} times: {self._story()}")

    def wait_lost(self) -> None:
        """Until the line is not up."""
        wait_until(lambda: self.states[-1:] == ["LOST"], lambda: f"not lost: {self._story()}")

    def wait_words(self, count: int) -> None:
        """Until so many words came."""
        wait_until(lambda: len(self.words) >= count, lambda: f"{len(self.words)} of {count} words: {self._story()}")

    def wait_packets(self, count: int) -> None:
        """Until so many packets came."""
        wait_until(lambda: len(self.sequences) >= count, lambda: f"{len(self.sequences)} packets: {self._story()}")

    def _story(self) -> str:
        return f"{self.states} {self.reasons} {self.link.all_counters()}"

    def _take(self, _adapter: str, reading: Reading) -> None:
        self.lost += reading.lost
        self.recorded += reading.data
        for packet in self.link.framer.feed(reading.data):
            self.link.count(packet)
            self.sequences.append(packet.sequence)
            if packet.type == f.WORDS_429:
                self.words += [word for _, word in struct.iter_unpack("<II", packet.body)]
            elif packet.type == f.WORD_708:
                self.radar_words.append(packet.body[2:])

    def _say(self, _adapter: str, state: str, reason: str) -> None:
        self.states.append(state)
        self.reasons += [reason] if reason else []

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._supervisor.stop()
        self._thread.join(DEADLINE_S)
        assert self.states[-1] == "CLOSED"


def recorded_frames(recorded: bytes) -> list[Frame]:
    """The frames in what a CAN adapter records, checked to be extended data frames."""
    frames = []
    while recorded:
        _, identifier, _, length = struct.unpack_from(f.CAN_RECORD, recorded)
        assert identifier >> 29 == f.CAN_EXTENDED >> 29
        start = struct.calcsize(f.CAN_RECORD)
        frames.append(Frame(identifier & 0x1FFF_FFFF, recorded[start : start + length]))
        recorded = recorded[start + length :]
    return frames
