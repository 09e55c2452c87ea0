"""A scenario all the way to the line: its packets through a carrier."""

from collections.abc import Iterator

from simulators.carriers import Carrier, Unit, stream
from simulators.ledger import Ledger
from simulators.scenario import Scenario
from simulators.traffic import traffic


def units(scenario: Scenario, carrier: Carrier[Unit], ledger: Ledger | None = None) -> Iterator[tuple[int, Unit]]:
    """What goes down the line, each with the ns at which it is ready, in that order, made on demand.

    The same scenario gives the same units. The books are kept in `ledger`. Raises as `traffic` does.
    """
    for ready_ns, packet in traffic(scenario, ledger):
        for unit in carrier.units(packet):
            yield ready_ns, unit


def whole_stream(scenario: Scenario) -> bytes:
    """All that a serial line carries."""
    return b"".join(frame for _, frame in units(scenario, stream()))
