"""Real sockets on the loopback interface: who may send, and what the kernel had no room for."""

import socket
from collections.abc import Iterator

import pytest

from decoders.datagrams import split
from gateway.adapters import Port, sockets
from gateway.adapters.udp import UdpAdapter, make
from gateway.config import AdapterConfig
from gateway.errors import GatewayError
from tests.gateway.reading import data_of, open_source, read_units

CONFIG = AdapterConfig(name="bridge", source="udp:127.0.0.1:1")


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        yield line


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


def listen(query: str = "", host: str = "127.0.0.1") -> tuple[Port, tuple[str, int]]:
    port = free_port()
    return open_source(f"udp:{host}:{port}{query}"), (host, port)


def test_each_datagram_is_kept_whole_with_its_arrival(sender: socket.socket) -> None:
    line, address = listen()
    sent = [bytes([k % 256]) * k for k in (1, 200, 4096, 1, 0, 65_000)]
    for data in sent:
        sender.sendto(data, address)
    found = list(split(data_of(read_units(line, len(sent)))))
    assert [data for _, data in found] == sent
    arrivals = [arrival_ns for arrival_ns, _ in found]
    assert arrivals == sorted(arrivals)
    line.close()


def test_a_silent_line_gives_nothing_after_a_short_wait() -> None:
    line, _ = listen()
    assert (line.read().data, line.read().units) == (b"", 0)
    line.close()


def test_only_the_senders_that_may_speak_are_recorded_and_others_are_told_once() -> None:
    line, address = listen("?from=127.0.0.1,127.0.0.2")
    for host in ("127.0.0.9", "127.0.0.2", "127.0.0.9", "127.0.0.1"):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.bind((host, 0))
            sender.sendto(host.encode(), address)
    readings = read_units(line, 2)
    assert [data for _, data in split(data_of(readings))] == [b"127.0.0.2", b"127.0.0.1"]
    (remark,) = [reading.remark for reading in readings if reading.remark]
    assert remark == "datagrams from 127.0.0.9 are refused: only 127.0.0.1, 127.0.0.2 may send"
    line.close()


def test_what_the_kernel_has_no_room_for_is_counted_though_nothing_follows_it(
    sender: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.adapters.udp.RECEIVE_BYTES", 4096)
    line, address = listen()
    sent = 100
    for _ in range(sent):
        sender.sendto(bytes(200), address)
    arrived = read_units(line, 1)
    sender.sendto(b"later", address)
    later = read_units(line, 1)
    kept = sum(reading.units for reading in arrived)
    assert 0 < kept < sent
    assert sum(reading.lost for reading in arrived) == sent - kept
    assert sum(reading.lost for reading in later) == 0
    line.close()


def test_a_multicast_group_is_joined() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        port = free_port()
        line = UdpAdapter("239.74.163.9", port, frozenset(), "127.0.0.1").open()
        sender.sendto(b"to all", ("239.74.163.9", port))
        assert data_of(read_units(line, 1)).endswith(b"to all")
        line.close()


def test_an_address_in_use_is_named_with_the_mend() -> None:
    line, (host, port) = listen()
    with pytest.raises(GatewayError, match=f"udp {host}:{port}: in use: another program"):
        open_source(f"udp:{host}:{port}")
    line.close()


def test_an_address_of_another_machine_is_refused_with_the_mend() -> None:
    with pytest.raises(GatewayError, match=r"udp 192\.0\.2\.1:7001: not an address of this machine"):
        open_source("udp:192.0.2.1:7001?from=any")


@pytest.mark.parametrize(
    "address",
    ["", "127.0.0.1", "127.0.0.1:0", "127.0.0.1:99999", "localhost:7001", "127.0.0.1:7001?form=1.2.3.4", "[::1]:7001"],
)
def test_an_address_that_cannot_be_one_is_refused_with_what_to_write(address: str) -> None:
    with pytest.raises(GatewayError, match=r"write udp:127\.0\.0\.1:PORT"):
        make(address, CONFIG)


def test_beyond_this_machine_it_must_be_said_who_may_send() -> None:
    with pytest.raises(GatewayError, match=r"udp 0\.0\.0\.0:7001: others can reach it, so say who may send"):
        make("0.0.0.0:7001", CONFIG)
    assert make("0.0.0.0:7001?from=any", CONFIG).senders == frozenset()
    assert make("0.0.0.0:7001?from=10.0.0.7", CONFIG).senders == {"10.0.0.7"}
    assert make("127.0.0.1:7001", CONFIG).senders == frozenset()


def test_the_kernel_is_asked_for_room_for_more_than_a_second_of_all_buses() -> None:
    line, _ = listen()
    size = line._line.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)  # type: ignore[attr-defined]
    assert size >= min(sockets.RECEIVE_BYTES, 212_992)  # the kernel's own limit for those who are not root
    line.close()
