"""Which framer reads what an adapter has recorded."""

from collections.abc import Callable
from typing import NamedTuple

from decoders.can_frames import Recorded, Slcan, Socketcand
from decoders.datagrams import BareFramer, DatagramFramer
from decoders.framing import PacketFramer
from decoders.racklink import Framer
from decoders.racklink_can import CanFramer
from gateway.config import AdapterConfig


class Form(NamedTuple):
    """How an adapter's bytes are read, and what the units are that it can lose."""

    framer: Callable[[], PacketFramer]
    unit: str


STREAM = Form(Framer, "bytes")
DATAGRAMS = {"racklink": Form(DatagramFramer, "datagrams"), "bare708": Form(BareFramer, "datagrams")}
CAN_TEXTS = {
    "slcan": Form(lambda: CanFramer(Slcan()), "bytes"),
    "socketcand": Form(lambda: CanFramer(Socketcand()), "bytes"),
}
CAN = Form(lambda: CanFramer(Recorded()), "frames")


def form_of(config: AdapterConfig) -> Form:
    """The form in which the adapter of a configuration records."""
    kind, _, address = config.source.partition(":")
    if kind == "udp":
        return DATAGRAMS[config.framing]
    if kind == "can":
        return CAN_TEXTS.get(address.partition(":")[0], CAN)
    return STREAM
