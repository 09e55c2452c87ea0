"""A recording taken apart into what once came down a line, each with its time: for loopback tests in the laboratory."""

import struct
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from decoders import formats as f
from decoders.datagrams import split
from decoders.framing import Packet
from gateway.config import AdapterConfig, RackConfig
from gateway.errors import GatewayError
from gateway.framing import form_of
from gateway.recording import Recording
from gateway.records import Raw

CAN_HEAD = struct.Struct(f.CAN_RECORD)
FD_FRAME = 0x04  # of SocketCAN's FD flags
CARRIERS = {"bytes": "stream", "datagrams": "datagram", "frames": "can"}  # by what an adapter's units are


class CanFrame(NamedTuple):
    """A data frame with an identifier of 29 bits, or of 11."""

    identifier: int
    data: bytes
    fd: bool
    extended: bool


def chosen(config: RackConfig, name: str | None) -> AdapterConfig:
    """The adapter of that name, or the only one. Raises GatewayError naming those that there are."""
    known = ", ".join(adapter.name for adapter in config.adapters)
    if name is None and len(config.adapters) > 1:
        raise GatewayError(f"the recording has several adapters: name one of {known} with --adapter")
    for adapter in config.adapters:
        if name in (None, adapter.name):
            return adapter
    raise GatewayError(f"--adapter {name}: the recording has no such adapter, use one of {known}")


def carrier_of(config: AdapterConfig) -> str | None:
    """How the adapter's line carried packets: stream, datagram, can or slcan. None if ours goes down no line so."""
    kind, _, address = config.source.partition(":")
    if kind == "file" and config.framing != "candump":
        return None
    if kind == "can" and address.startswith(("slcan:", "socketcand:")):
        return "slcan" if address.startswith("slcan:") else None
    return CARRIERS[form_of(config).unit]


class Sent:
    """What an adapter of a recording received, to be sent again; `left_out` counts what cannot be."""

    def __init__(self, recording: Recording, config: AdapterConfig) -> None:
        self.left_out: Counter[str] = Counter()
        self._recording = recording
        self._config = config

    def units(self) -> Iterator[tuple[int, bytes | CanFrame]]:
        """Pieces of a stream or of text as they were read, datagrams, or CAN frames, each with its monotonic ns."""
        carrier = carrier_of(self._config)
        for record in self._chunks():
            if carrier == "datagram":
                yield from split(record.data)
            elif carrier == "can":
                yield from self._frames(record.data)
            else:
                yield record.stamp.monotonic_ns, record.data

    def packets(self) -> Iterator[tuple[int, Packet]]:
        """The packets of what was received, for a line of another kind, each with the monotonic ns of its chunk."""
        framer = form_of(self._config).framer()
        for record in self._chunks():
            for packet in framer.feed(record.data):
                yield record.stamp.monotonic_ns, packet
        faults = {"bytes between packets": framer.skipped + framer.pending}
        self.left_out.update({what: count for what, count in faults.items() if count})

    def _chunks(self) -> Iterator[Raw]:
        for record in self._recording:
            if isinstance(record, Raw) and record.adapter == self._config.name and record.data:
                yield record

    def _frames(self, chunk: bytes) -> Iterator[tuple[int, CanFrame]]:
        at = 0
        while at + CAN_HEAD.size <= len(chunk):
            arrival_ns, identifier, flags, length = CAN_HEAD.unpack_from(chunk, at)
            at += CAN_HEAD.size + length
            if identifier & (f.CAN_ERROR | f.CAN_REMOTE):
                self.left_out["error and remote frames"] += 1
                continue
            extended = bool(identifier & f.CAN_EXTENDED)
            frame = CanFrame(identifier & 0x1FFF_FFFF, chunk[at - length : at], bool(flags & FD_FRAME), extended)
            yield arrival_ns, frame
