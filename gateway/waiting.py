"""Bus words that wait until somebody asks what they say. Decoded packet by packet they would cost ten times as much.

How long they wait depends on records and device times alone, so a replay reads them at the same records as live.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders import formats as f
from decoders.racklink import Joined
from gateway.channels import Channel429, Channel708
from gateway.link import Link
from monitor.scans import SweepWatch

Numbers = Sequence[int] | NDArray[np.int64]

WAIT_NS: Final = 1_000_000_000
LONGEST_WAIT_NS: Final = 10 * WAIT_NS  # where nobody asks before
MOST_RADIALS: Final = 1024


class Radar(NamedTuple):
    """Radar words of a channel: common times (n,) ns, and their bytes (n, word)."""

    link: Link
    channel: Channel708
    times_ns: NDArray[np.int64]
    words: NDArray[np.uint8]


class WaitingWords:
    """Words of one ARINC 429 channel in order of time."""

    def __init__(self, channel: Channel429) -> None:
        self.channel = channel
        self.end_ns = 0  # of the last word that waits
        self.until_ns: int | None = None  # device time from which on no packet can join; None while nothing waits
        self._joined: list[Joined] = []

    def __len__(self) -> int:
        """Words that wait, those included that will be left out."""
        return sum(len(joined.words) + joined.left_out for joined in self._joined)

    def put(self, joined: Joined, until_ns: int, end_ns: int) -> None:
        """Let words wait, and say until when others can join them and when the last one was sent."""
        self._joined.append(joined)
        self.until_ns, self.end_ns = until_ns, end_ns

    def take(self) -> Joined | None:
        """All that waits, if anything does."""
        if not self._joined:
            return None
        time_ns, sent_ns, words, malformed, left_out = zip(*self._joined, strict=True)
        self._joined, self.until_ns = [], None
        return Joined(
            np.concatenate(time_ns), np.concatenate(sent_ns), np.concatenate(words), sum(malformed), sum(left_out)
        )


class WaitingRadials:
    """Radar words of the channel in use, while it is certain that none of them ends its sweep."""

    def __init__(self) -> None:
        self.link: Link | None = None
        self.channel: Channel708 | None = None
        self.watch = SweepWatch()
        self._count = 0
        self._times_ns: list[Numbers] = []
        self._words: list[bytes | memoryview] = []

    def __len__(self) -> int:
        """Words that wait."""
        return self._count

    def put(self, link: Link, channel: Channel708, device_ns: int, offset_ns: int, word: bytes) -> bool:
        """Let a word of the channel's length wait; whether it may. All that waits is of one channel."""
        goes_on = self.watch.goes_on(device_ns, int.from_bytes(word[: f.HEADER_708_BYTES], "little", signed=True))
        self.put_all(link, channel, [device_ns + offset_ns], word)
        return goes_on and len(self) < MOST_RADIALS

    def put_all(self, link: Link, channel: Channel708, times_ns: Numbers, words: bytes | memoryview) -> None:
        """Let words wait that `watch` has seen and that may, one behind the other."""
        self.link, self.channel = link, channel
        self._count += len(times_ns)
        self._times_ns.append(times_ns)
        self._words.append(words)

    def take(self) -> Radar | None:
        """All that waits, if anything does."""
        if not self._times_ns or self.link is None or self.channel is None:
            return None
        words = np.frombuffer(b"".join(self._words), np.uint8).reshape(len(self), -1)
        times_ns = np.concatenate(self._times_ns, dtype=np.int64)
        self._count, self._times_ns, self._words = 0, [], []
        return Radar(self.link, self.channel, times_ns, words)
