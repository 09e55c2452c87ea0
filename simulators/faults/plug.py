"""Faults of the plug: pulled out in the middle of a packet, and put in again."""

from collections.abc import Iterator
from enum import Enum
from typing import Any, TypeVar

from numpy.random import Generator

from simulators.faults import Change, through
from simulators.scenario import LinkFault, Scenario

Unit = TypeVar("Unit")


class Plug(Enum):
    """What happens to the plug; the value is the methods of an outlet that do it.

    What was written before is read first, so that the same seed loses the same bytes however slow the reader is.
    """

    OUT = ("drain", "unplug")
    IN = ("replug",)


def plugged(units: Iterator[tuple[int, Unit]], scenario: Scenario) -> Iterator[tuple[int, Unit | Plug]]:
    """The units, with what happens to the plug between them; for an outlet that can be unplugged."""
    return through(units, scenario.link_faults, FAULTS, scenario.seed)


def _unplug(units: Iterator[tuple[int, Any]], fault: LinkFault, _: Generator) -> Iterator[tuple[int, Any]]:
    """Only the first half of the unit under way gets through, and of later ones nothing."""
    plug_in = True
    for ready_ns, unit in units:
        if plug_in and fault.covers(ready_ns):
            plug_in = False
            if isinstance(unit, bytes):
                yield ready_ns, unit[: len(unit) // 2]
            yield ready_ns, Plug.OUT
            continue
        if not plug_in and not fault.covers(ready_ns):
            plug_in = True
            yield round(fault.stop_s * 1e9), Plug.IN
        yield ready_ns, unit


FAULTS: dict[str, Change] = {"unplug": _unplug}
