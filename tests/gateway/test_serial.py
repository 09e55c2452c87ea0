"""Real lines: a pseudo-terminal, a socket and an RFC 2217 server, and what their ends do to the bytes before them."""

import os
import random
import select
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.adapters import NOTHING, Port, make_adapter
from gateway.config import AdapterConfig
from gateway.errors import GatewayError
from simulators.outlets import PtyOutlet
from tests.gateway.live import wait_until
from tests.gateway.rfc2217_server import Server

DATA = random.Random(1).randbytes(200_000)


def open_port(address: str) -> Port:
    return make_adapter(AdapterConfig(name="bridge", source=f"serial:{address}")).open()


def read_until(port: Port, size: int) -> bytes:
    received = bytearray()

    def enough() -> bool:
        received.extend(port.read().data)
        return len(received) >= size

    wait_until(enough, f"{size} bytes")
    return bytes(received)


def read_to_the_end(port: Port) -> bytes:
    received = bytearray()

    def ended() -> bool:
        try:
            received.extend(port.read().data)
        except OSError:
            return True
        return False

    wait_until(ended, "the end of the line")
    return bytes(received)


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


def address_of(server: socket.socket) -> str:
    return f"socket://127.0.0.1:{server.getsockname()[1]}"


def test_a_pseudo_terminal_gives_every_byte() -> None:
    with PtyOutlet() as outlet:
        port = open_port(outlet.path)
        sender = threading.Thread(target=outlet.write, args=(DATA,))
        sender.start()
        assert read_until(port, len(DATA)) == DATA
        sender.join(10)
        port.close()


def test_bytes_that_came_before_the_line_was_opened_are_kept() -> None:
    with PtyOutlet() as outlet:
        outlet.write(DATA[:1000])
        port = open_port(outlet.path)
        assert read_until(port, 1000) == DATA[:1000]
        port.close()


def test_a_silent_line_gives_nothing_after_a_short_wait() -> None:
    with PtyOutlet() as outlet:
        port = open_port(outlet.path)
        assert port.read() == NOTHING
        port.close()


def test_a_line_whose_other_end_goes_away_raises_and_closes_quietly() -> None:
    with PtyOutlet() as outlet:
        port = open_port(outlet.path)
    assert read_to_the_end(port) == b""
    port.close()
    port.close()


def test_a_socket_gives_every_byte_even_those_just_before_its_end(server: socket.socket) -> None:
    port = open_port(address_of(server))
    client, _ = server.accept()

    def send_and_leave() -> None:
        client.sendall(DATA)
        client.close()

    sender = threading.Thread(target=send_and_leave)
    sender.start()
    assert read_to_the_end(port) == DATA
    sender.join(10)
    port.close()


def test_the_kernel_asks_whether_a_silent_peer_is_still_there(server: socket.socket) -> None:
    port = open_port(address_of(server))
    peer = port._line._socket  # type: ignore[attr-defined]
    assert peer.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
    options = (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT)
    assert [peer.getsockopt(socket.IPPROTO_TCP, option) for option in options] == [5, 2, 3]
    port.close()


def test_a_line_whose_device_has_gone_is_said_to_be_unplugged(monkeypatch: pytest.MonkeyPatch) -> None:
    with PtyOutlet() as outlet:
        port = open_port(outlet.path)
        monkeypatch.setattr(select, "select", lambda *_: ([port], [], []))  # as the kernel says of a line that has gone
        with pytest.raises(OSError, match="unplugged, or its other end is closed"):
            port.read()
        port.close()


def test_a_silent_socket_gives_nothing_after_a_short_wait(server: socket.socket) -> None:
    port = open_port(address_of(server))
    client, _ = server.accept()
    assert port.read() == NOTHING
    client.sendall(b"words")
    assert read_until(port, 5) == b"words"
    client.close()
    port.close()


@pytest.mark.filterwarnings("ignore:set:DeprecationWarning")  # pyserial's own
def test_a_remote_line_gives_every_byte() -> None:
    with Server() as remote:
        port = open_port(remote.url)
        remote.send(DATA[:20_000])
        assert read_until(port, 20_000) == DATA[:20_000]
        port.close()


@pytest.mark.filterwarnings("ignore:set:DeprecationWarning")
def test_a_remote_line_gives_the_bytes_just_before_its_end() -> None:
    with Server() as remote:
        port = open_port(remote.url)
        remote.send(DATA[:20_000])
        remote.hang_up()
        assert read_to_the_end(port) == DATA[:20_000]
        port.close()


def plain_file(tmp_path: Path) -> str:
    (tmp_path / "file").write_text("no line")
    return str(tmp_path / "file")


def deserted(tmp_path: Path) -> str:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return address_of(listener)


@pytest.mark.parametrize(
    ("make", "mend"),
    [
        (lambda tmp_path: "/dev/no-such-line", "no such device: plug it in"),
        (plain_file, "not a serial line"),
        (deserted, "connection refused: nothing listens"),
        (lambda tmp_path: "nothing://here", "protocol"),
    ],
)
def test_a_line_that_cannot_be_opened_is_named_with_the_mend(
    tmp_path: Path, make: Callable[[Path], str], mend: str
) -> None:
    address = make(tmp_path)
    with pytest.raises(GatewayError, match=mend) as caught:
        open_port(address)
    assert address in str(caught.value)


def test_a_line_that_another_program_holds_is_named_with_the_mend() -> None:
    with PtyOutlet() as outlet:
        holder = open_port(outlet.path)
        with pytest.raises(GatewayError, match=f"{outlet.path}: in use: another program holds the line"):
            open_port(outlet.path)
        holder.close()


def test_an_unknown_kind_of_source_is_named_with_those_that_are_known() -> None:
    with pytest.raises(GatewayError, match=r"source 'tin:can': unknown kind 'tin', use one of serial"):
        make_adapter(AdapterConfig(name="bridge", source="tin:can"))


def test_the_line_is_raw_so_that_no_byte_means_anything_to_the_terminal() -> None:
    master, slave = os.openpty()  # left in its cooked mode
    port = open_port(os.ttyname(slave))
    every = bytes(range(256))
    os.write(master, every)
    assert read_until(port, 256) == every
    port.close()
    os.close(slave)
    os.close(master)
