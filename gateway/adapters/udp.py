"""UDP: each datagram is a message of its own."""

import contextlib
import errno
import ipaddress
import socket
import struct
import time
from urllib.parse import parse_qsl, urlsplit

from decoders import formats as f
from gateway.adapters import NOTHING, Reading
from gateway.adapters.sockets import RECEIVE_BYTES, Overflows, prepare, wait
from gateway.config import AdapterConfig
from gateway.errors import GatewayError

HEAD = struct.Struct(f.DATAGRAM_RECORD)
LARGEST_DATAGRAM = 65_535
MOST_AT_ONCE = 512
ANY = "any"
DEFAULT_INTERFACE = "0.0.0.0"  # noqa: S104 # the one that the kernel's routes choose, for a multicast group

MENDS = {
    errno.EADDRINUSE: "in use: another program listens there",
    errno.EADDRNOTAVAIL: "not an address of this machine: see `ip address`",
    errno.EACCES: "no permission: take a port from 1024 on",
}


class UdpPort:
    """An open socket. Datagrams of senders that are not allowed are not recorded."""

    def __init__(self, line: socket.socket, senders: frozenset[str]) -> None:
        self._line = line
        self._senders = senders
        self._overflows = Overflows(line)
        self._strangers: set[str] = set()
        self._sender: tuple[str, int] | None = None

    def read(self) -> Reading:
        """The datagrams that have come, up to 512."""
        if not wait(self._line):
            return NOTHING
        chunk, count, remark = bytearray(), 0, ""
        with contextlib.suppress(BlockingIOError):
            for _ in range(MOST_AT_ONCE):
                data, sender = self._line.recvfrom(LARGEST_DATAGRAM)
                if self._senders and sender[0] not in self._senders:
                    remark = remark or self._refused(sender[0])
                    continue
                if sender != self._sender:
                    remark = remark or self._another(sender)
                chunk += HEAD.pack(time.monotonic_ns(), len(data)) + data
                count += 1
        return Reading(bytes(chunk), count, self._overflows.new(), remark)

    def close(self) -> None:
        """Close the socket."""
        self._line.close()

    def _another(self, sender: tuple[str, int]) -> str:
        """What to say of a sender that is not the one before it, once."""
        before, self._sender = self._sender, sender
        name = "{}:{}".format(*sender)
        if before is None or name in self._strangers or len(self._strangers) >= MOST_AT_ONCE:
            return ""
        self._strangers |= {name, "{}:{}".format(*before)}
        return f"datagrams come from {name}, before from {before[0]}:{before[1]}: give each bridge a port of its own"

    def _refused(self, sender: str) -> str:
        """What to say of a sender, once."""
        if sender in self._strangers or len(self._strangers) >= MOST_AT_ONCE:
            return ""
        self._strangers.add(sender)
        return f"datagrams from {sender} are refused: only {', '.join(sorted(self._senders))} may send"


class UdpAdapter:
    """A local address to listen at; a multicast group is joined."""

    def __init__(self, host: str, port: int, senders: frozenset[str], interface: str) -> None:
        self.host = host
        self.port = port
        self.senders = senders
        self.interface = interface

    def open(self) -> UdpPort:
        """Bind the socket. Raises GatewayError with the mend."""
        line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            prepare(line, RECEIVE_BYTES)
            if ipaddress.ip_address(self.host).is_multicast:
                line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                group = socket.inet_aton(self.host) + socket.inet_aton(self.interface)
                line.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
            line.bind((self.host, self.port))
        except OSError as error:
            line.close()
            mend = MENDS.get(error.errno or 0, error.strerror)
            raise GatewayError(f"udp {self.host}:{self.port}: {mend}") from error
        return UdpPort(line, self.senders)


def make(address: str, config: AdapterConfig) -> UdpAdapter:  # noqa: ARG001 # every kind is made alike
    """The adapter of `udp:HOST:PORT`, or with `?from=ADDRESS,ADDRESS` and, for a multicast group, `&interface=ADDRESS`.

    Beyond the loopback interface it must be said who may send. Raises GatewayError for any other address.
    """
    try:
        parts = urlsplit(f"//{address}")
        host, port = ipaddress.IPv4Address(parts.hostname or ""), parts.port
        options = dict(parse_qsl(parts.query, strict_parsing=bool(parts.query)))
        said, interface = (
            options.pop("from", ""),
            str(ipaddress.IPv4Address(options.pop("interface", DEFAULT_INTERFACE))),
        )
        senders = frozenset(str(ipaddress.IPv4Address(sender)) for sender in said.split(",") if said not in ("", ANY))
    except ValueError as error:
        raise GatewayError(f"udp {address}: {error}: write udp:127.0.0.1:PORT?from=ADDRESS") from error
    if not port or options:
        raise GatewayError(f"udp {address}: write udp:127.0.0.1:PORT with a port from 1 to 65535, and perhaps ?from=")
    if not host.is_loopback and not said:
        raise GatewayError(
            f"udp {address}: others can reach it, so say who may send: ?from=ADDRESS, several with commas, or ?from=any"
        )
    return UdpAdapter(str(host), port, senders, interface)
