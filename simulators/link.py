"""A scenario all the way to the line: its packets through a carrier, and through the faults of that line."""

from collections.abc import Iterator

from simulators.carriers import Carrier, Unit, stream
from simulators.faults import Change, device, link, plug, through
from simulators.ledger import Ledger
from simulators.scenario import Scenario
from simulators.traffic import traffic


def units(scenario: Scenario, carrier: Carrier[Unit], ledger: Ledger | None = None) -> Iterator[tuple[int, Unit]]:
    """What goes down the line, each with the ns at which it is ready, in that order, made on demand.

    The same scenario gives the same units. The books are kept in `ledger`. Faults of the plug are left to
    `faults.plug.plugged`. Raises ValueError for a link fault that this kind of line cannot have, and as `traffic` does.
    """
    possible: dict[str, Change] = link.FAULTS[carrier.name]
    for fault in scenario.link_faults:
        if fault.name not in {*device.FAULTS, *possible, *plug.FAULTS}:
            raise ValueError(f"link fault {fault.name} cannot be on {carrier.name}: leave it out")
    sent = ((ready_ns, unit) for ready_ns, packet in traffic(scenario, ledger) for unit in carrier.units(packet))
    return through(sent, scenario.link_faults, possible, scenario.seed)


def whole_stream(scenario: Scenario) -> bytes:
    """All that a serial line carries."""
    return b"".join(frame for _, frame in units(scenario, stream()))
