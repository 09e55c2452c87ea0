"""Buses of python-can that need no device: virtual, multicast, slcan on a pseudo-terminal, socketcand over TCP."""

import os
import socket
import threading
from collections.abc import Iterator
from typing import Any

import can
import pytest

from decoders.can_frames import Recorded, Slcan, Socketcand
from gateway.adapters.can import make
from gateway.config import AdapterConfig
from gateway.errors import GatewayError
from simulators.outlets import PtyOutlet
from tests.gateway.reading import data_of, open_source, read_units

CONFIG = AdapterConfig(name="bridge", source="can:virtual:x")
FRAMES = [(0x1601008B, bytes(range(k))) for k in range(9)]


def messages(fd: bool = False) -> list[can.Message]:
    longer = [(0x16000010, bytes(range(64)))] if fd else []
    return [can.Message(arbitration_id=i, data=data, is_fd=fd, bitrate_switch=fd) for i, data in FRAMES + longer]


def found(chunk: bytes) -> list[tuple[int, bytes]]:
    return [(frame.identifier, frame.data) for frame in Recorded().feed(chunk)]


@pytest.mark.parametrize("fd", [False, True])
@pytest.mark.parametrize("place", ["virtual:a", "udp_multicast:239.74.163.2?port=43113"])
def test_every_frame_of_a_bus_is_recorded(place: str, fd: bool) -> None:
    interface, _, rest = place.partition(":")
    channel, _, query = rest.partition("?")
    options: dict[str, Any] = {"port": 43113, "hop_limit": 0} if query else {}
    line = open_source(f"can:{place}{'&' if query else '?'}fd={str(fd).lower()}")
    with can.Bus(channel, interface, fd=fd, **options) as bus:
        sent = messages(fd)
        for message in sent:
            bus.send(message)
        assert found(data_of(read_units(line, len(sent)))) == [(m.arbitration_id, bytes(m.data)) for m in sent]
    line.close()


def test_other_frames_are_recorded_with_what_they_are() -> None:
    line = open_source("can:virtual:a")
    with can.Bus("a", "virtual") as bus:
        bus.send(can.Message(arbitration_id=5, is_extended_id=False, data=b"std"))
        bus.send(can.Message(arbitration_id=5, is_remote_frame=True))
        bus.send(can.Message(arbitration_id=5, is_error_frame=True))
        chunk = data_of(read_units(line, 3))
    line.close()
    reader = Recorded()
    assert (reader.feed(chunk), reader.counters) == ([], {"foreign_frames": 2, "error_frames": 1})


def test_a_silent_bus_gives_nothing_after_a_short_wait() -> None:
    line = open_source("can:virtual:a")
    assert (line.read().data, line.read().units) == (b"", 0)
    line.close()


def test_text_of_an_slcan_adapter_is_recorded_as_it_comes_garbage_and_all() -> None:
    with PtyOutlet() as pty:
        line = open_source(f"can:slcan:{pty.path}")
        text = b"T1601008B20102\r\xff\xfeT16010\rT1601008B0\r"  # bytes that python-can's own parser never gets over
        pty.write(text)
        assert data_of(read_units(line, len(text))) == text
        line.close()
    assert [(frame.identifier, frame.data) for frame in Slcan().feed(text)] == [
        (0x1601008B, b"\1\2"),
        (0x1601008B, b""),
    ]


def test_an_slcan_adapter_is_set_up_and_opened() -> None:
    master, slave = os.openpty()
    path = os.ttyname(slave)
    line = open_source(f"can:slcan:{path}?bitrate=1000000")
    asked = b""
    while len(asked) < len(b"C\rS8\r\rO\rO\r"):  # which comes in pieces
        asked += os.read(master, 100)
    assert asked == b"C\rS8\r\rO\rO\r"
    line.close()
    assert os.read(master, 100) == b"C\r"
    os.close(slave)
    os.close(master)


class Server:
    """A socketcand server for one client."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.asked: list[bytes] = []
        self.client: socket.socket | None = None
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()

    def _serve(self) -> None:
        self.client, _ = self.listener.accept()
        self.client.sendall(b"< hi >")
        for _ in range(2):
            self.asked.append(self.client.recv(100))
            self.client.sendall(b"< ok >")

    def send(self, text: bytes) -> None:
        self.thread.join(10)
        assert self.client
        self.client.sendall(text)

    def close(self) -> None:
        self.thread.join(10)
        if self.client:
            self.client.close()
        self.listener.close()


@pytest.fixture
def server() -> Iterator[Server]:
    running = Server()
    yield running
    running.close()


def test_text_of_a_socketcand_server_is_recorded_as_it_comes_garbage_and_all(server: Server) -> None:
    line = open_source(f"can:socketcand:can0?host=127.0.0.1&port={server.port}")
    text = b"< frame 1601008B 1.5 0102 >< frame 16\xff zz >< frame 1601008B 1.6 03 >"
    server.send(text)
    assert data_of(read_units(line, len(text))) == text
    assert server.asked == [b"< open can0 >", b"< rawmode >"]
    assert [frame.data for frame in Socketcand().feed(text)] == [b"\1\2", b"\3"]
    server.close()
    with pytest.raises(ConnectionError, match="the server has hung up"):
        read_units(line, 1)
    line.close()


@pytest.mark.parametrize("address", ["", "virtual", "virtual:", "nonsense:can0"])
def test_an_address_that_cannot_be_one_is_refused_with_what_to_write(address: str) -> None:
    with pytest.raises(GatewayError, match=r"write can:INTERFACE:CHANNEL with an interface of .*socketcan"):
        make(address, CONFIG)


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ("slcan:/dev/nowhere", "can slcan:/dev/nowhere: no such device: plug it in"),
        ("socketcand:can0?host=127.0.0.1&port=1", "can socketcand:can0: connection refused: start socketcand there"),
        ("socketcan:can99", "can can99: (no such interface|this kernel has no CAN)"),
        ("slcan:/dev/null?bitrate=7", "can slcan:/dev/null: .*"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_named_with_what_its_driver_says(source: str, complaint: str) -> None:
    with pytest.raises(GatewayError, match=complaint):
        open_source(f"can:{source}")


def test_options_of_the_kernel_s_interfaces_are_the_kernel_s() -> None:
    with pytest.raises(GatewayError, match="set up with `ip link`"):
        make("socketcan:can0?bitrate=500000", CONFIG)
