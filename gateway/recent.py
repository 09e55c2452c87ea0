"""The latest packets of a bridge, of which most are never looked at again."""

from collections import deque
from collections.abc import Iterable, Iterator

from decoders.framing import Packet, Packets

RECENT = 32  # packets among which a network may repeat or overtake one


class Recent:
    """Iterates over the packets in their order. What came as columns becomes objects only then."""

    def __init__(self) -> None:
        self._kept: deque[tuple[Packets, int] | Packet] = deque(maxlen=RECENT)

    def append(self, packet: Packet) -> None:
        """Keep a packet."""
        self._kept.append(packet)

    def extend(self, packets: Packets, which: Iterable[int]) -> None:
        """Keep some of many packets."""
        self._kept.extend((packets, k) for k in which)

    def __iter__(self) -> Iterator[Packet]:
        """Each of them as an object."""
        for kept in self._kept:
            yield kept if isinstance(kept, Packet) else kept[0].packet(kept[1])
