"""CAN through python-can; SocketCAN has a module of its own, and text protocols are recorded as the text that comes.

CAN controllers acknowledge what they receive; nothing here sends a frame. Where the gateway must not even acknowledge,
the interface can be opened with `?listen_only=true`, if it knows that.
"""

import contextlib
import errno
import logging
import re
import socket
import struct
import time
from typing import Any
from urllib.parse import parse_qsl

import can
from can.interfaces.socketcand import socketcand

from decoders import formats as f
from gateway.adapters import NOTHING, Adapter, Port, Reading, serial, stream
from gateway.adapters.socketcan import SocketCanAdapter
from gateway.adapters.sockets import LONGEST_WAIT_S, wait
from gateway.config import AdapterConfig
from gateway.errors import GatewayError

# What a driver has to say of a failure is in its exceptions; its log would repeat it on the console for ever.
logging.getLogger("can").addHandler(logging.NullHandler())
logging.getLogger("can").propagate = False

HEAD = struct.Struct(f.CAN_RECORD)
MOST_AT_ONCE = 512
CONNECT_S = 2.0
LARGEST_READ = 65_536
MENDS = {**serial.MENDS, errno.ECONNREFUSED: "connection refused: start socketcand there, or mend ?host= and &port="}
WORDS = {"true": True, "false": False}
DEFAULTS: dict[str, dict[str, Any]] = {
    "slcan": {"sleep_after_open": 0.0},  # python-can's own 2 s, for boards that restart, are an option
    "udp_multicast": {"hop_limit": 0},  # stays on this machine unless ?hop_limit= says otherwise
}


class BusPort:
    """An open python-can bus that gives messages."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def read(self) -> Reading:
        """The frames that have come, up to 512."""
        message = self._bus.recv(LONGEST_WAIT_S)
        chunk, count = bytearray(), 0
        while message is not None:
            identifier = message.arbitration_id
            identifier |= f.CAN_EXTENDED * message.is_extended_id
            identifier |= f.CAN_REMOTE * message.is_remote_frame | f.CAN_ERROR * message.is_error_frame
            flags = message.bitrate_switch | message.error_state_indicator << 1 | message.is_fd << 2  # as SocketCAN's
            chunk += HEAD.pack(time.monotonic_ns(), identifier, flags, len(message.data)) + message.data
            count += 1
            message = self._bus.recv(0) if count < MOST_AT_ONCE else None
        return Reading(bytes(chunk), count) if count else NOTHING

    def close(self) -> None:
        """Shut the bus down; a driver whose device has gone may object in any way."""
        with contextlib.suppress(Exception):
            self._bus.shutdown()


class TextPort:
    """A bus whose frames are text on a line: recorded as it comes, so that garbage in it wedges nothing."""

    def __init__(self, bus: can.BusABC, line: Port) -> None:
        self._bus = bus
        self._line = line

    def read(self) -> Reading:
        """Whatever has come, up to 64 KiB."""
        return self._line.read()

    def close(self) -> None:
        """Close the line; python-can would say goodbye first, to a device that may have gone."""
        with contextlib.suppress(Exception):
            self._bus.shutdown()
        self._line.close()


class TcpLine:
    """The connection of a socketcand bus."""

    def __init__(self, line: socket.socket) -> None:
        self._line = line

    def read(self) -> Reading:
        """Whatever has come, up to 64 KiB."""
        if not wait(self._line):
            return NOTHING
        data = self._line.recv(LARGEST_READ)
        if not data:
            raise ConnectionError("the server has hung up")
        return stream(data)

    def close(self) -> None:
        """Close the connection."""
        self._line.close()


class CanAdapter:
    """A bus by python-can's interface, channel and options."""

    def __init__(self, interface: str, channel: str, options: dict[str, Any]) -> None:
        self.interface = interface
        self.channel = channel
        self.options = options

    def open(self) -> Port:
        """Open the bus. Raises GatewayError with what the driver says."""
        place = f"can {self.interface}:{self.channel}"
        try:
            bus = can.Bus(interface=self.interface, channel=self.channel, ignore_config=True, **self.options)
        except Exception as error:  # each driver has kinds of its own
            raise GatewayError(
                f"{place}: {MENDS.get(serial.error_number(error.__context__ or error)) or error}"
            ) from error
        if self.interface == "slcan":
            line = getattr(bus, "serialPortOrig")  # noqa: B009 # of the driver
            line.timeout = 0
            return TextPort(bus, serial.SerialPort(line, telnet="://" in self.channel))
        if self.interface == "socketcand":
            return TextPort(bus, TcpLine(getattr(bus, "_SocketCanDaemonBus__socket")))  # noqa: B009 # as above
        return BusPort(bus)


def _connect(line: socket.socket, host: str, port: int) -> None:
    """Connect soon or not at all: python-can would try for ten seconds, and wait for the greeting for ever."""
    line.settimeout(CONNECT_S)
    try:
        line.connect((host, port))
    except OSError:
        line.close()
        raise


socketcand.connect_to_server = _connect


def make(address: str, config: AdapterConfig) -> Adapter:  # noqa: ARG001 # every kind is made alike
    """The adapter of `can:INTERFACE:CHANNEL?option=value&...`, the options being those of python-can's interface.

    Raises GatewayError for an interface that python-can does not know.
    """
    interface, _, rest = address.partition(":")
    channel, _, query = rest.partition("?")
    if interface not in can.VALID_INTERFACES or not channel:
        known = ", ".join(sorted(can.VALID_INTERFACES))
        raise GatewayError(f"can {address}: write can:INTERFACE:CHANNEL with an interface of {known}")
    options = {name: _value(text) for name, text in parse_qsl(query, keep_blank_values=True)}
    if interface == "socketcan":
        if options.keys() - {"fd"}:
            raise GatewayError(f"can {address}: the kernel's interfaces are set up with `ip link`, not with options")
        return SocketCanAdapter(channel)
    return CanAdapter(interface, channel, DEFAULTS.get(interface, {}) | options)


def _value(text: str) -> Any:
    """An option as python-can takes it: a truth, a number or a text."""
    if text in WORDS:
        return WORDS[text]
    if re.fullmatch(r"-?\d+", text):
        return int(text)
    return float(text) if re.fullmatch(r"-?\d*\.\d+", text) else text
