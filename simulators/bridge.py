"""The device between buses and host: it numbers packets, says who it is, and counts the words that it passes on."""

from collections.abc import Iterable, Iterator

from decoders.formats import FLAG_FIFO_OVERFLOW, HEARTBEAT, HELLO
from simulators import racklink
from simulators.ledger import Ledger
from simulators.racklink import Packet
from simulators.schedule import Due

SERIAL_NUMBER, FIRMWARE = 1, 0x0100
HELLO_NS = 10_000_000_000
HEARTBEAT_NS = 1_000_000_000
OWN_CHANNEL = 0  # of packets that tell of the bridge itself


def hello(time_ns: int) -> Due:
    """A hello; its body is made when it is sent."""
    return Due(time_ns, OWN_CHANNEL, HELLO, time_ns, b"")


def heartbeat(time_ns: int) -> Due:
    """A heartbeat; its counts are filled in when it is sent."""
    return Due(time_ns, OWN_CHANNEL, HEARTBEAT, time_ns, b"")


def routine(start_ns: int, end_ns: int) -> Iterator[Due]:
    """The hellos and heartbeats of [start, end)."""
    for interval, make in ((HELLO_NS, hello), (HEARTBEAT_NS, heartbeat)):
        for time_ns in range(-(-start_ns // interval) * interval, end_ns, interval):
            yield make(time_ns)


class Bridge:
    """Makes packets of what is due, and keeps the books in `ledger`."""

    def __init__(self, kinds: dict[int, tuple[int, int]], ledger: Ledger) -> None:
        """`kinds` gives each channel's kind and equipment identity."""
        self._kinds = kinds
        self._ledger = ledger
        self._sequence = 0

    def packets(self, dues: Iterable[Due]) -> Iterator[tuple[int, Packet]]:
        """Packets with the ns at which each is ready, made one by one, so that each knows of the losses before it."""
        for due in dues:
            self._ledger.carry(due.channel, due.type, due.words)
            if due.lost:
                self._ledger.lose(due.channel, due.type, due.words)
            else:
                yield due.ready_ns, self._packet(due)

    def _packet(self, due: Due) -> Packet:
        flags = due.flags
        if due.words and due.channel in self._ledger.overflowed:
            self._ledger.overflowed.remove(due.channel)
            flags |= FLAG_FIFO_OVERFLOW
        packet = Packet(due.type, due.channel, flags, self._sequence, due.time_ns, self._body(due))
        self._sequence += 1
        return packet

    def _body(self, due: Due) -> bytes:
        if due.type == HELLO:
            listed = ((number, kind, 0, equipment) for number, (kind, equipment) in self._kinds.items())
            return racklink.hello(SERIAL_NUMBER, FIRMWARE, listed)
        if due.type == HEARTBEAT:
            return racklink.heartbeat((number, *self._ledger.counts(number)) for number in self._kinds)
        return due.body
