"""Adapters bring bytes in. Each kind is one module, imported when a source names it."""

from importlib import import_module
from typing import NamedTuple, Protocol

from gateway.config import AdapterConfig
from gateway.errors import GatewayError

KINDS = {
    "serial": "gateway.adapters.serial",
    "usb": "gateway.adapters.usb",
    "can": "gateway.adapters.can",
    "udp": "gateway.adapters.udp",
}


class Reading(NamedTuple):
    """What one read gave: bytes as they are recorded, how many units they are, and how many were lost before them.

    A unit is a byte of a stream, or a message: a CAN frame, a datagram. `remark` is for people, of trouble that the
    line has overcome.
    """

    data: bytes
    units: int
    lost: int = 0
    remark: str = ""


NOTHING = Reading(b"", 0)


def stream(data: bytes) -> Reading:
    """A reading of a stream."""
    return Reading(data, len(data))


class Port(Protocol):
    """An opened source."""

    def read(self) -> Reading:
        """What has come, or `NOTHING` after a short wait. Any exception means that the port is lost."""

    def close(self) -> None:
        """Let the device go; never raises for a device that is gone already."""


class Adapter(Protocol):
    """A source that can be opened again and again. Listen-only: nothing here can write."""

    def open(self) -> Port:
        """Open the device, or raise OSError or another error that says why not."""


def make_adapter(config: AdapterConfig) -> Adapter:
    """The adapter that a source such as `serial:/dev/ttyUSB0` names."""
    kind, _, address = config.source.partition(":")
    if kind == "file":
        raise GatewayError(f"source {config.source!r} is a file that was imported, no line: `shadebus replay` plays it")
    if kind not in KINDS:
        raise GatewayError(f"source {config.source!r}: unknown kind {kind!r}, use one of {', '.join(KINDS)}")
    adapter: Adapter = import_module(KINDS[kind]).make(address, config)
    return adapter
