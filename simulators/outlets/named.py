"""Outlets by the names that `simulate --to` takes."""

import ipaddress
import socket
from pathlib import Path
from typing import Any, NamedTuple

from simulators import carriers
from simulators.carriers import Carrier
from simulators.outlets import FileOutlet, PtyOutlet, SlcanOutlet, TcpOutlet, UdpOutlet

FORMS = "pty, pty:LINK, tcp:PORT, file:PATH, udp:HOST:PORT, slcan or can:INTERFACE:CHANNEL; the last two take ?fd=true"
FD = "?fd=true"
LAST_PORT = 65_535


class Way(NamedTuple):
    """An outlet, and how packets are carried to it."""

    outlet: Any
    carrier: Carrier[Any]


def named(text: str) -> Way:
    """The outlet of a name; its `place` is what a gateway calls it, if it can listen to it.

    Raises ValueError for any other text, and OSError where the system does not grant it.
    """
    fd = text.startswith(("slcan", "can:")) and text.endswith(FD)
    kind, _, address = (text.removesuffix(FD) if fd else text).partition(":")
    match kind:
        case "pty":
            return Way(PtyOutlet(_link(address)), carriers.stream())
        case "tcp":
            return Way(TcpOutlet(_port(address or "0")), carriers.stream())
        case "file" if address:
            return Way(FileOutlet(Path(address)), carriers.stream())
        case "udp" if ":" in address:
            host, _, port = address.rpartition(":")
            number = _port(port)
            return Way(UdpOutlet(_here(host), number), carriers.datagram())
        case "slcan" if not address:
            return Way(SlcanOutlet(), carriers.slcan(fd))
        case "can" if ":" in address:
            from simulators.outlets.canbus import CanOutlet  # noqa: PLC0415 # python-can takes its time to import

            interface, _, channel = address.partition(":")
            return Way(CanOutlet(interface, channel, fd), carriers.can(fd))
    raise ValueError(f"use {FORMS}")


def _link(text: str) -> Path | None:
    """A name for a terminal; one that something else has is refused, as it would be replaced."""
    link = Path(text) if text else None
    if link and link.exists() and not link.is_symlink():
        raise ValueError(f"{link} is there already and no link of ours: choose another name")
    return link


def _here(host: str) -> str:
    """A host that is this machine: a simulated bridge must not be taken for a real one on somebody's network."""
    address = socket.getaddrinfo(host.strip("[]"), None)[0][4][0]
    if not ipaddress.ip_address(address).is_loopback:
        raise ValueError(f"{host} is another machine: a simulation is sent to this one alone, such as 127.0.0.1")
    return host


def _port(text: str) -> int:
    if not (text.isdecimal() and int(text) <= LAST_PORT):
        raise ValueError(f"{text!r} is no port: use 1 to {LAST_PORT}, or for tcp 0 for a free one")
    return int(text)
