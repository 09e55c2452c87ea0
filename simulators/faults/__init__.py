"""What goes wrong between the buses and the host, in the three places where it can: the device, the link, the plug.

A fault is a function that takes what passes in order and gives what comes of it, so faults follow one another as the
scenario lists them. Each draws from a random stream of its own: the same seed gives the same faults.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from simulators.scenario import LinkFault

FAULT_STREAM = 8

Item = TypeVar("Item")
Change = Callable[[Iterator[Any], LinkFault, np.random.Generator], Iterator[Any]]


def through(
    items: Iterator[Item], faults: Sequence[LinkFault], table: Mapping[str, Change], seed: int
) -> Iterator[Item]:
    """What comes of the items after those faults that the table knows."""
    for number, fault in enumerate(faults):
        if fault.name in table:
            items = table[fault.name](items, fault, np.random.default_rng((seed, FAULT_STREAM, number)))
    return items
