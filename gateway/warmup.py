"""Load the compiled kernels of the way from bytes to words before the first bytes need them."""

import numpy as np

from decoders.arinc429 import decode
from decoders.definitions import load_definitions
from decoders.formats import KIND_429_HIGH, WORDS_429
from decoders.health429 import BusHealth
from decoders.racklink import Framer, Packet, joined429
from gateway.timebase import Timebase
from monitor.aircraft import Aircraft
from monitor.scans import SweepWatch

COARSE, FINE = 0o110, 0o120  # halves of a latitude, which are joined
NORMAL = 3  # SSM
LATER_NS = 2_000_000_000  # so that the bus has a second that is over


def warm_up_words() -> None:
    """Read a made-up packet of two words and forget what it says."""
    Framer().feed(bytes(1))
    Timebase(["adapter"]).offset_ns("adapter", 0, 0)
    SweepWatch().goes_on(0, 0)
    definitions = load_definitions("gnss_743a")
    entries = b"".join(bytes(4) + _word(label).to_bytes(4, "little") for label in (COARSE, FINE))
    joined = joined429(Packet(WORDS_429, 0, 0, 0, 0, entries), 0)
    values = decode(joined.words, definitions)
    health = BusHealth(definitions, "wire", KIND_429_HIGH)
    for _ in health.feed(joined.time_ns + np.array([0, LATER_NS]), joined.words, values):
        pass
    Aircraft().feed(definitions, joined.sent_ns, joined.words, values)


def _word(label: int) -> int:
    """A word of ARINC 429 with data of zeros and odd parity."""
    word = int(f"{label:08b}"[::-1], 2) | NORMAL << 29
    return word | (1 - word.bit_count() % 2) << 31
