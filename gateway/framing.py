"""Which framer reads what an adapter has recorded."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from decoders import formats, vendors
from decoders.can_frames import Recorded, Slcan, Socketcand
from decoders.datagrams import BareFramer, DatagramFramer
from decoders.framing import PacketFramer
from decoders.racklink import Framer
from decoders.racklink_can import CanFramer
from decoders.vendor_records import FRAMERS, RecordFramer
from gateway.config import AdapterConfig


class Form(NamedTuple):
    """How an adapter's bytes are read, and what the units are that it can lose."""

    framer: Callable[[], PacketFramer]
    unit: str
    advice: str  # where something comes, and no packet
    checked: bool = True  # whether a checksum, ours or CAN's, keeps altered words out


SPEAKS = "check the baud rate and that the bridge speaks RackLink"
FRAMES = "check that the bridge sends RackLink's identifiers and that its bit rate is the bus's"
STREAM = Form(Framer, "bytes", SPEAKS)
DATAGRAMS = {
    "racklink": Form(DatagramFramer, "datagrams", 'check that the sender speaks RackLink, or set framing = "bare708"'),
    "bare708": Form(BareFramer, "datagrams", "check that each datagram is one radar word"),
}
CAN_TEXTS = {
    "slcan": Form(lambda: CanFramer(Slcan()), "bytes", FRAMES, checked=False),
    "socketcand": Form(lambda: CanFramer(Socketcand()), "bytes", FRAMES, checked=False),
}
CAN = Form(lambda: CanFramer(Recorded()), "frames", FRAMES)
RECORDS = "check that the file is of the layout that it was imported from"


def record_framer(config: AdapterConfig) -> RecordFramer:
    """The framer of an imported file, with what the configuration says beyond the layout."""
    said = config.vendor.model_dump(exclude_none=True)
    for name in ("flags_429", "flags_708"):
        if name in said:
            said[name] = {getattr(formats, f"FLAG_{flag.upper()}"): mask for flag, mask in said[name].items()}
    reading = replace(vendors.READINGS[config.framing], **said)
    return FRAMERS[config.framing](reading, next(iter(config.channels), 0))


def form_of(config: AdapterConfig) -> Form:
    """The form in which the adapter of a configuration records."""
    kind, _, address = config.source.partition(":")
    if kind == "udp":
        return DATAGRAMS[config.framing]
    if kind == "file" and config.framing != "candump":
        return Form(lambda: record_framer(config), "bytes", RECORDS)
    if kind == "file":
        return CAN
    if kind == "can":
        return CAN_TEXTS.get(address.partition(":")[0], CAN)
    return STREAM
