"""No byte is lost, nothing is early, and everything ends when told to."""

import itertools
import os
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import serial

from simulators.outlets import Closed, FileOutlet, Outlet, PtyOutlet, TcpOutlet, UdpOutlet
from simulators.outlets.named import named
from simulators.player import play

DATA = bytes(range(256)) * 1200  # every byte value, and far more than the kernel holds


def collect(read: Callable[[], bytes], size: int, into: bytearray, pause_s: float = 0.0) -> threading.Thread:
    def run() -> None:
        while len(into) < size and (chunk := read()):
            into.extend(chunk)
            time.sleep(pause_s)

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def test_a_pseudo_terminal_delivers_every_byte_to_a_slow_reader() -> None:
    received = bytearray()
    with PtyOutlet() as outlet:
        reader = os.open(outlet.path, os.O_RDONLY | os.O_NOCTTY)
        thread = collect(lambda: os.read(reader, 3000), len(DATA), received, pause_s=0.001)
        for start in range(0, len(DATA), 10_000):
            outlet.write(DATA[start : start + 10_000])
    thread.join(10)
    os.close(reader)
    assert received == DATA


def test_closing_a_pseudo_terminal_waits_for_its_reader() -> None:
    received = bytearray()
    outlet = PtyOutlet()
    reader = os.open(outlet.path, os.O_RDONLY | os.O_NOCTTY)
    outlet.write(DATA[:4000])
    threading.Timer(0.2, lambda: received.extend(os.read(reader, 4000))).start()
    outlet.close()
    outlet.close()
    os.close(reader)
    assert received == DATA[:4000]


def test_draining_a_pseudo_terminal_waits_for_its_reader_and_leaves_it_open() -> None:
    received = bytearray()
    with PtyOutlet() as outlet:
        reader = os.open(outlet.path, os.O_RDONLY | os.O_NOCTTY)
        for _ in range(2):
            outlet.write(DATA[:4000])
            threading.Timer(0.2, lambda: received.extend(os.read(reader, 4000))).start()
            outlet.drain()
            time.sleep(0.05)  # the terminal is empty a moment before the reader has put its bytes away
        os.close(reader)
    assert received == 2 * DATA[:4000]


def test_a_writer_that_waits_for_nobody_is_released_by_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simulators.outlets.pty.DRAIN_S", 0.1)
    outlet = PtyOutlet()
    threading.Timer(0.3, outlet.close).start()
    with pytest.raises(Closed):
        outlet.write(DATA)


def test_a_pseudo_terminal_drops_what_its_host_writes_so_that_the_host_never_waits() -> None:
    with PtyOutlet() as outlet, serial.Serial(outlet.path, timeout=5, write_timeout=5) as host:
        for _ in range(20):
            host.write(b"S6\rO\r" * 200)
            outlet.write(b"x")
            assert host.read(1) == b"x"
        assert host.in_waiting == 0  # and nothing is answered or echoed


def test_an_unplugged_pseudo_terminal_fails_its_reader_and_comes_back_under_another_name() -> None:
    with PtyOutlet() as outlet:
        with serial.Serial(outlet.path, timeout=5) as host:
            first = outlet.path
            outlet.write(b"before")
            assert host.read(6) == b"before"
            outlet.unplug()
            with pytest.raises((serial.SerialException, OSError)):
                host.read(1)
        outlet.write(b"vanishes")
        outlet.replug()
        assert outlet.path != first
        with serial.Serial(outlet.path, timeout=5) as host:
            outlet.write(b"after")
            assert host.read(5) == b"after"


def test_a_link_is_the_lasting_name_of_a_pseudo_terminal(tmp_path: Path) -> None:
    link = tmp_path / "usb-bridge"
    with PtyOutlet(link) as outlet:
        assert outlet.place == f"serial:{link}"
        assert link.readlink() == Path(outlet.path)
        outlet.unplug()
        assert not link.is_symlink()
        outlet.replug()
        assert link.readlink() == Path(outlet.path)
    assert not link.is_symlink()


def test_unplugging_releases_a_writer_that_waits() -> None:
    with PtyOutlet() as outlet:
        threading.Timer(0.2, outlet.unplug).start()
        outlet.write(DATA)


def test_a_udp_listener_gets_each_unit_as_one_datagram() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5)
        port = listener.getsockname()[1]
        with UdpOutlet("127.0.0.1", port) as outlet:
            assert outlet.place == f"udp:127.0.0.1:{port}"
            outlet.write(b"one")
            outlet.write(b"two")
            (one, sender), (two, again) = listener.recvfrom(99), listener.recvfrom(99)
    assert (one, two) == (b"one", b"two")
    assert sender == again != ("127.0.0.1", port)
    with pytest.raises(Closed):
        outlet.write(b"three")


def test_datagrams_that_nobody_hears_are_no_error() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with UdpOutlet("127.0.0.1", port) as outlet:
        for _ in range(3):
            outlet.write(b"x")


@pytest.mark.parametrize(
    ("name", "place", "carrier"),
    [
        ("pty", "serial:/dev/pts/", "stream"),
        ("tcp:0", "serial:socket://127.0.0.1:", "stream"),
        ("tcp", "serial:socket://127.0.0.1:", "stream"),
        ("file:/tmp/a:b", "", "stream"),
        ("udp:127.0.0.1:9", "udp:127.0.0.1:9", "datagram"),
        ("udp:[::1]:9", "udp:[::1]:9", "datagram"),
        ("slcan", "can:slcan:/dev/pts/", "slcan"),
        ("slcan?fd=true", "can:slcan:/dev/pts/", "slcan"),
        ("can:virtual:a", "can:virtual:a", "can"),
        ("can:virtual:a?fd=true", "can:virtual:a?fd=true", "can"),
    ],
)
def test_a_name_gives_an_outlet_and_how_packets_are_carried_to_it(name: str, place: str, carrier: str) -> None:
    way = named(name)
    with way.outlet as outlet:
        assert outlet.place.startswith(place)
    assert way.carrier.name == carrier


@pytest.mark.parametrize("name", ["", "tin", "pty?fd=true", "file", "udp:9", "udp:host:x", "slcan:x", "can:a"])
def test_a_name_without_an_outlet_is_refused_with_what_there_is(name: str) -> None:
    with pytest.raises(ValueError, match=r"^use pty, pty:LINK|is no port"):
        named(name)


@pytest.mark.parametrize("host", ["8.8.8.8", "192.168.1.7", "0.0.0.0", "[2001:db8::1]"])
def test_traffic_for_another_machine_is_refused(host: str) -> None:
    with pytest.raises(ValueError, match="is another machine"):
        named(f"udp:{host}:9")


def test_a_file_that_is_there_already_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "kept").write_bytes(b"kept")
    with FileOutlet(tmp_path / "kept") as outlet, pytest.raises(FileExistsError):
        outlet.write(b"new")
    assert (tmp_path / "kept").read_bytes() == b"kept"


def test_a_tcp_client_gets_every_byte_and_then_the_end() -> None:
    received = bytearray()
    with TcpOutlet() as outlet:
        client = socket.create_connection(outlet.address)
        thread = collect(lambda: client.recv(5000), 10**9, received)
        outlet.write(DATA)
    thread.join(10)
    client.close()
    assert received == DATA


def test_a_tcp_client_that_leaves_ends_the_playing() -> None:
    with TcpOutlet() as outlet:
        socket.create_connection(outlet.address).close()
        played = play(((k, DATA[:1000]) for k in itertools.count()), outlet)
    assert played.units < 10_000


def test_a_tcp_outlet_without_a_client_is_released_by_close() -> None:
    outlet = TcpOutlet()
    threading.Timer(0.2, outlet.close).start()
    with pytest.raises(Closed):
        outlet.write(b"x")


def test_a_file_holds_the_stream(tmp_path: Path) -> None:
    with FileOutlet(tmp_path / "bus.bin") as outlet:
        played = play([(0, b"ab"), (10**12, b"c")], outlet, speed=float("inf"))
    assert (tmp_path / "bus.bin").read_bytes() == b"abc"
    assert (played.units, played.size_bytes) == (2, 3)


class Clocked(Outlet[bytes]):
    """Notes when each packet arrives."""

    def __init__(self) -> None:
        self.times: list[float] = []

    def write(self, data: bytes) -> None:
        self.times.append(time.monotonic())

    def close(self) -> None: ...


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_packets_are_played_at_their_device_times_and_never_early(speed: float) -> None:
    due_ns = [7_000_000_000 + 20_000_000 * k for k in range(20)]
    clocked = Clocked()
    played = play(((time_ns, b"x") for time_ns in due_ns), clocked, speed)
    lateness = [
        (arrived - clocked.times[0]) - (due - due_ns[0]) / 1e9 / speed
        for arrived, due in zip(clocked.times, due_ns, strict=True)
    ]
    assert min(lateness) > -0.001
    assert played.worst_lateness_s >= max(lateness) - 0.001
    assert played.worst_lateness_s < 0.5


def test_stop_ends_the_playing_at_once() -> None:
    stop = threading.Event()
    threading.Timer(0.1, stop.set).start()
    began = time.monotonic()
    played = play(((k * 10**9, b"x") for k in range(100)), Clocked(), stop=stop)
    assert time.monotonic() - began < 1.0
    assert played.units == 1


def test_a_speed_of_nought_is_refused() -> None:
    with pytest.raises(ValueError, match="speed"):
        play([], Clocked(), speed=0.0)


def test_a_terminal_takes_no_name_that_something_else_has(tmp_path: Path) -> None:
    link = tmp_path / "bridge"
    with named(f"pty:{link}").outlet as outlet:
        assert (outlet.place, link.is_symlink()) == (f"serial:{link}", True)
    assert not link.exists()
    link.write_text("mine")
    with pytest.raises(ValueError, match="bridge is there already and no link of ours"):
        named(f"pty:{link}")
    assert link.read_text() == "mine"
