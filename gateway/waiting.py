"""Bus words that wait until somebody asks what they say. Decoded packet by packet they would cost ten times as much.

How long they wait depends on records and device times alone, so a replay reads them at the same records as live.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders import formats as f
from decoders.racklink import ENTRY_429, Joined, Packet, joined429
from gateway.channels import Channel708
from gateway.link import Link
from monitor.scans import SweepWatch

LONGEST_WAIT_NS = 1_000_000_000
MOST_RADIALS = 1024


class Words(NamedTuple):
    """ARINC 429 words of a channel, and what to add to the device time of each (n,) for the common time, ns."""

    joined: Joined
    offset_ns: NDArray[np.int64]


class WaitingWords:
    """Packets of one ARINC 429 channel in order of time."""

    def __init__(self) -> None:
        self._packets: list[Packet] = []
        self._offsets_ns: list[int] = []
        self._end_ns = 0

    def __len__(self) -> int:
        """Words that wait."""
        return sum(len(packet.body) // ENTRY_429.itemsize for packet in self._packets)

    def has_room_for(self, packet: Packet) -> bool:
        """Whether a packet can join: it does not overtake what waits, and nothing waits for too long."""
        return not self._packets or self._end_ns <= packet.time_ns < self._packets[0].time_ns + LONGEST_WAIT_NS

    def put(self, packet: Packet, offset_ns: int) -> None:
        """Let a packet wait; `offset_ns` leads from its device time to the common one."""
        self._packets.append(packet)
        self._offsets_ns.append(offset_ns)
        self._end_ns = packet.time_ns + int.from_bytes(packet.body[-8:-4], "little")

    def take(self) -> Words | None:
        """All that waits, if anything does."""
        if not self._packets:
            return None
        joined = joined429(self._packets)
        offset_ns = np.array(self._offsets_ns, np.int64)[joined.packet]
        self._packets, self._offsets_ns = [], []
        return Words(joined, offset_ns)


class WaitingRadials:
    """Radar words of the channel in use, while it is certain that none of them ends its sweep."""

    def __init__(self) -> None:
        self.link: Link | None = None
        self.channel: Channel708 | None = None
        self._times_ns: list[int] = []
        self._words: list[bytes] = []
        self._watch = SweepWatch()

    def __len__(self) -> int:
        """Words that wait."""
        return len(self._words)

    def put(self, link: Link, channel: Channel708, time_ns: int, word: bytes) -> bool:
        """Let a word of the channel's length wait; whether it may. All that waits is of one channel."""
        self.link, self.channel = link, channel
        self._times_ns.append(time_ns)
        self._words.append(word)
        goes_on = self._watch.goes_on(time_ns, int.from_bytes(word[: f.HEADER_708_BYTES], "little"))
        return goes_on and len(self._words) < MOST_RADIALS

    def take(self) -> tuple[NDArray[np.int64], NDArray[np.uint8]] | None:
        """Times (n,) and bytes (n, word) of all that waits, if anything does."""
        if not self._words:
            return None
        words = np.frombuffer(b"".join(self._words), np.uint8).reshape(len(self._words), -1)
        times_ns = np.array(self._times_ns, np.int64)
        self._times_ns, self._words = [], []
        return times_ns, words
