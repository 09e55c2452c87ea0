"""Load the compiled kernels before the first bytes need them."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from decoders.arinc429 import decode
from decoders.definitions import load_definitions
from decoders.formats import KIND_429_HIGH, WORDS_429
from decoders.health429 import BusHealth
from decoders.racklink import Framer, Packet, joined429
from gateway.timebase import Timebase, follow
from monitor.aircraft import Aircraft
from monitor.integrity import Monitor
from monitor.scans import SweepWatch
from monitor.warmup import warm_up

COARSE, FINE = 0o110, 0o120  # halves of a latitude, which are joined
NORMAL = 3  # SSM
COMPILING = "first start on this machine: compiling for half a minute"
LATER_NS = 2_000_000_000  # so that the bus has a second that is over


def compiled() -> bool:
    """Whether an earlier start has kept kernels. The first start on a machine compiles them for half a minute."""
    return any(Path(str(follow.stats.cache_path)).glob("timebase.follow-*.nbi"))


def warm_up_gateway(monitor: Monitor) -> None:
    """Load all that bytes need on their way to a verdict; what must be compiled first, on two cores.

    Numba compiles on one core of a process, so a process of its own does it for the words.
    """
    compiler = None if compiled() else _compiler()
    warm_up(monitor)
    if compiler:
        compiler.wait()
    warm_up_words()


def _compiler() -> subprocess.Popen[bytes]:
    command = (sys.executable, "-m", __name__)
    # Our stdout is for events, and a Ctrl-C is for us.
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)  # noqa: S603 # our own


def warm_up_words() -> None:
    """Load what makes words of bytes: read a made-up packet of two words and forget what it says."""
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


if __name__ == "__main__":
    warm_up_words()
