"""A recording transmitted once more, into the shipped gateway: all words arrive again, in order, with the verdicts."""

import json
import os
import socket
import struct
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import can
import pytest
from typer.testing import CliRunner

from decoders.datagrams import split
from decoders.framing import PacketFramer
from gateway.cli import app
from gateway.config import RackConfig, check_config
from gateway.errors import GatewayError
from gateway.framing import form_of
from gateway.imports.plan import Wish
from gateway.imports.run import import_files
from gateway.metadata import build_monitor, describe, recorded_config
from gateway.recording import Recorder, Recording
from gateway.records import Raw, Record, Stamp, Status, Tick
from simulators.carriers import Frame, datagram, slcan_line
from simulators.link import units
from simulators.scenario import Scenario
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live, raw_records, recorded_bytes, replayed, wait_until
from tests.gateway.made import Bridge
from tests.gateway.shell import GATEWAY, START_S
from tests.gateway.vendor_files import seqrecord, words_of

Timed = Iterable[tuple[int, bytes]]
SPEED = "10"


def recorded(path: Path, config: RackConfig, chunks: Timed, adapter: str = "bridge") -> Path:
    """A recording of chunks as they were read, with their times, and a tick a second."""
    recorder = Recorder(path, describe(config, build_monitor(config)))
    found: list[Record] = [Status(0, Stamp(0, 0), adapter, "UP")]
    for time_ns, data in chunks:
        while time_ns // 10**9 > (found[-1].stamp.monotonic_ns // 10**9):
            stamp = (found[-1].stamp.monotonic_ns // 10**9 + 1) * 10**9
            found.append(Tick(len(found), Stamp(stamp, stamp)))
        found.append(Raw(len(found), Stamp(time_ns, time_ns), adapter, data))
    recorder.append(found)
    recorder.close()
    return path


def words(path: Path) -> list[tuple[int, int, int, bytes]]:
    """Every bus word of a recording: kind of packet, channel, device time and the word."""
    found = []
    (adapter,) = recorded_config(Recording(path).metadata).adapters
    framer: PacketFramer = form_of(adapter).framer()
    for record in raw_records(path):
        for packet in framer.feed(record.data):
            if packet.type == 0x10:
                parts = struct.iter_unpack("<I4s", packet.body)
                found += [(0x10, packet.channel, packet.time_ns + offset, word) for offset, word in parts]
            elif packet.type == 0x20:
                found.append((0x20, packet.channel, packet.time_ns, packet.body[2:]))
    return found


ARRIVAL = ("time_ns", "sequence", "reasons")


def figures(lines: list[str]) -> list[dict[str, Any]]:
    """Scans and verdicts without the stamps of their arrival, and without reasons: a line that ends is one."""
    told = [event for event in map(json.loads, lines) if event["type"] in ("scan", "integrity")]
    return [{name: said for name, said in event.items() if name not in ARRIVAL} for event in told]


class Transmitting:
    """`shadebus simulate --from` in a `with` block."""

    def __init__(self, path: Path, to: str, *more: str) -> None:
        command = [*GATEWAY, "simulate", "--from", str(path), "--to", to, *more]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.place = self.process.stdout.readline().strip()

    def end(self) -> str:
        _, told = self.process.communicate(timeout=START_S)
        assert self.process.returncode == 0, told
        return told

    def __enter__(self) -> "Transmitting":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()


def test_over_a_terminal_the_gateway_hears_every_byte_again_and_says_the_same(
    flight: list[tuple[int, bytes]], make_rack: MakeRack, tmp_path: Path
) -> None:
    first = recorded(tmp_path / "first.mcap", make_rack(terrain=[TERRAIN]), flight)
    stream = b"".join(data for _, data in flight)
    with Transmitting(first, f"pty:{tmp_path / 'line'}", "--speed", SPEED) as line:
        with Live(make_rack(line.place, terrain=[TERRAIN])) as live:
            live.wait_for_bytes(len(stream))
        assert line.end().startswith(f"{len(flight)} pieces, {len(stream)} bytes")
    assert recorded_bytes(live.path) == stream
    assert words(live.path) == words(first)
    assert figures(live.lines) == figures(replayed(first))
    assert sum(event["type"] == "integrity" for event in figures(live.lines)) == 3


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


def datagrams(scenario: Scenario) -> list[tuple[int, bytes]]:
    sent = units(scenario, datagram())
    return [(ready_ns, struct.pack("<QH", ready_ns, len(data)) + data) for ready_ns, data in sent]


def test_over_udp_each_datagram_goes_out_by_itself(scenario: Scenario, make_rack: MakeRack, tmp_path: Path) -> None:
    source = f"udp:127.0.0.1:{free_port()}"
    rack = make_rack(source, terrain=[TERRAIN])
    chunks = datagrams(scenario)
    grouped = [(chunks[k : k + 3][-1][0], b"".join(d for _, d in chunks[k : k + 3])) for k in range(0, len(chunks), 3)]
    first = recorded(tmp_path / "first.mcap", rack, grouped)
    with Live(rack) as live:
        live.wait_for("status", state="UP")
        told = transmitted(
            first, "--to", source, "--speed", SPEED
        )  # here, lest the radar is quiet while a process starts
        wait_until(lambda: len(words(live.path)) == len(words(first)), "all words")
    assert told.startswith(f"{len(chunks)} datagrams, ")
    assert [data for record in raw_records(live.path) for _, data in split(record.data)] == [d[10:] for _, d in chunks]
    assert words(live.path) == words(first)
    assert figures(live.lines) == figures(replayed(first))


FRAMES = (
    Frame(0x1601008B, bytes.fromhex("8b800c6060e31600"), False),
    Frame(0x123, b"\1\2", False, extended=False),
    Frame(0x16012000, bytes.fromhex("0200000002000000"), False),
)
ERROR = struct.pack("<QIBB", 3, 0x2000_0004, 0, 8) + bytes(8)


def can_record(time_ns: int, frame: Frame, flags: int = 0) -> bytes:
    identifier = frame.id | frame.extended << 31
    return struct.pack("<QIBB", time_ns, identifier, flags | 4 * frame.fd, len(frame.data)) + frame.data


def can_recording(path: Path, make_rack: MakeRack, frames: Iterable[Frame]) -> Path:
    chunk = b"".join(can_record(1000 * k, frame) for k, frame in enumerate(frames)) + ERROR
    return recorded(path, make_rack("can:socketcan:can0"), [(4000, chunk)])


def transmitted(*arguments: str | Path) -> str:
    """What `simulate --from` told on its end, run in this process."""
    done = CliRunner().invoke(app, ["simulate", "--from", *map(str, arguments)])
    assert done.exception is None
    return done.stderr


def heard(bus: can.BusABC) -> list[Frame]:
    messages = iter(lambda: bus.recv(0), None)
    return [Frame(m.arbitration_id, bytes(m.data), m.is_fd, m.is_extended_id) for m in messages if m]


pytestmark = pytest.mark.usefixtures("signals_left_alone")


def test_can_frames_go_out_one_by_one_whosever_they_are(make_rack: MakeRack, tmp_path: Path) -> None:
    path = can_recording(tmp_path / "a.mcap", make_rack, FRAMES)
    with can.Bus(interface="virtual", channel="retransmission") as bus:
        told = transmitted(path, "--to", "can:virtual:retransmission")
        assert heard(bus) == [*FRAMES]
    assert told.startswith("3 frames, 18 bytes")
    assert told.endswith("left out: 1 error and remote frames\n")


def test_can_frames_go_down_a_serial_line_as_the_text_of_an_adapter(make_rack: MakeRack, tmp_path: Path) -> None:
    flexible = Frame(0x16001000, bytes(range(12)), True)
    assert [slcan_line(frame) for frame in (*FRAMES, flexible)] == [
        b"T1601008B88B800C6060E31600\r",
        b"t12320102\r",
        b"T1601200080200000002000000\r",
        b"B160010009000102030405060708090A0B\r",
    ]
    first = can_recording(tmp_path / "first.mcap", make_rack, 100 * FRAMES)  # more than the kernel holds unread
    text = 100 * b"".join(map(slcan_line, FRAMES))
    with Transmitting(first, "slcan") as line:
        terminal = os.open(line.place.removeprefix("can:slcan:"), os.O_RDWR | os.O_NOCTTY)
        found = b""
        while len(found) < len(text):
            found += os.read(terminal, 4096)
        os.close(terminal)
        line.end()
    assert found == text


def test_frames_of_can_fd_need_a_line_that_has_it(make_rack: MakeRack, tmp_path: Path) -> None:
    flexible = Frame(0x16001000, bytes(range(12)), True)
    path = can_recording(tmp_path / "a.mcap", make_rack, [flexible])
    done = CliRunner().invoke(app, ["simulate", "--from", str(path), "--to", "can:virtual:flexible"])
    assert isinstance(done.exception, GatewayError)
    assert "the recording has frames of CAN FD: write can:virtual:flexible?fd=true" in str(done.exception)
    with can.Bus(interface="virtual", channel="flexible", fd=True) as bus:
        transmitted(path, "--to", "can:virtual:flexible?fd=true")
        assert heard(bus) == [flexible]


def test_a_serial_recording_goes_out_as_datagrams_with_the_same_packets(
    scenario: Scenario, flight: list[tuple[int, bytes]], make_rack: MakeRack, tmp_path: Path
) -> None:
    path = recorded(tmp_path / "a.mcap", make_rack(), flight)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**22)
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(START_S)
        told = transmitted(path, "--to", "udp:{}:{}".format(*listener.getsockname()), "--speed", "20")
        found = [listener.recv(4096) for _ in flight]
    assert "packets of serial:/dev/null go out again as datagrams of their own" in told
    assert found == [data for _, data in units(scenario, datagram())]


def test_a_serial_recording_goes_out_on_can_with_every_word(
    flight: list[tuple[int, bytes]], make_rack: MakeRack, tmp_path: Path
) -> None:
    first = recorded(tmp_path / "first.mcap", make_rack(), flight)
    with can.Bus(interface="virtual", channel="words", fd=True) as bus:
        told = transmitted(first, "--to", "can:virtual:words?fd=true", "--speed", "1000")
        frames = heard(bus)
    assert "left out: 1 packets that such a line has no form for" in told  # the hello
    again = recorded(
        tmp_path / "again.mcap",
        make_rack("can:socketcan:can0"),
        [(k, can_record(k, frame)) for k, frame in enumerate(frames)],
    )
    assert [(kind, channel, word) for kind, channel, _, word in words(again)] == [
        (kind, channel, word) for kind, channel, _, word in words(first)
    ]
    late_ns = [a[2] - b[2] - 2**32 * 1000 for a, b in zip(words(again), words(first), strict=True)]  # one wrap above
    assert -1000 < min(late_ns) <= max(late_ns) <= 0  # a frame has whole microseconds


def test_a_file_of_an_interface_card_goes_out_as_packets_of_a_bridge(
    flight: list[tuple[int, bytes]], make_rack: MakeRack, tmp_path: Path
) -> None:
    sent = sorted(words_of(data for _, data in flight), key=lambda word: word[1])
    (tmp_path / "cards.bin").write_bytes(b"".join(map(seqrecord, sent)))
    import_files(Wish([tmp_path / "cards.bin"], "seqrecord"), tmp_path / "first.mcap", iter)
    transmitted(tmp_path / "first.mcap", "--to", f"file:{tmp_path / 'out.bin'}")
    again = recorded(tmp_path / "again.mcap", make_rack(), [(0, (tmp_path / "out.bin").read_bytes())])
    assert words(again) == words(tmp_path / "first.mcap")
    assert sorted((channel, word) for _, channel, _, word in words(again)) == sorted((w[0], w[2]) for w in sent)


def test_packets_that_cannot_be_frames_are_left_out_and_told(make_rack: MakeRack, tmp_path: Path) -> None:
    bridge = Bridge()
    chunk = bridge.packet(0x10, 1, 0.0, bytes(9)) + bridge.words(1, 0.1, [7], flags=4) + bridge.words(1, 0.2, [8])
    path = recorded(tmp_path / "a.mcap", make_rack(), [(0, chunk + b"garbage")])
    with can.Bus(interface="virtual", channel="odd") as bus:
        told = transmitted(path, "--to", "can:virtual:odd")
        assert [frame.data[:1] for frame in heard(bus)] == [b"\x08"]
    assert "left out: 2 packets that such a line has no form for" in told
    assert "left out: 7 bytes between packets" in told


def test_of_several_adapters_one_is_named(tmp_path: Path) -> None:
    table: dict[str, object] = {"adapters": [{"name": name, "source": "serial:x"} for name in ("left", "right")]}
    path = recorded(tmp_path / "a.mcap", check_config(table, "test"), [(0, b"one"), (1, b"two")], "right")
    out = tmp_path / "out.bin"
    for more, complaint in (
        ([], "the recording has several adapters: name one of left, right with --adapter"),
        (["--adapter", "top"], "--adapter top: the recording has no such adapter, use one of left, right"),
        (["--seed", "1"], "--from: a recording has no scenario, --seed or --duration: leave them out"),
    ):
        command = ["simulate", "--from", str(path), "--to", f"file:{out}", *more]
        assert str(CliRunner().invoke(app, command).exception) == complaint
    transmitted(path, "--to", f"file:{out}", "--adapter", "right")
    assert out.read_bytes() == b"onetwo"


def test_the_name_of_an_adapter_without_a_recording_is_refused() -> None:
    error = CliRunner().invoke(app, ["simulate", "--adapter", "x"]).exception
    assert str(error) == "--adapter is of a recording: name it with --from"
