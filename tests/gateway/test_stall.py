"""A disk that stands still for five seconds under three lines: what the queue holds is kept, the rest is counted."""

import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import can
import pytest
from cobs import cobs

from decoders import formats as f
from gateway.recording import Recorder, keeper
from gateway.records import Record
from simulators import racklink
from simulators.outlets import PtyOutlet
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live, wait_until
from tests.gateway.made import GNSS, Bridge, sweep
from tests.gateway.test_udp import free_port

STALL_S = 5.0
WORD = 0x8B  # label 321, of no consequence
BLOCK = 100  # words of a packet


class Disk:
    """Stands still once, when told to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.orders, self.stalled, disk = threading.Event(), threading.Event(), self

        class Stalling(Recorder):
            def append(self, records: Sequence[Record]) -> None:
                if disk.orders.is_set() and not disk.stalled.is_set():
                    disk.stalled.set()
                    time.sleep(STALL_S)
                super().append(records)

        monkeypatch.setattr(keeper, "Recorder", Stalling)


@dataclass
class Sender:
    """A bridge with one GNSS bus that counts what it sends, over any line."""

    name: str
    say: Callable[[bytes], None]
    bridge: Bridge = field(default_factory=Bridge)
    words: int = 0
    time_s: float = 0.0

    def block(self) -> None:
        self.time_s += 0.01
        self.words += BLOCK
        self.say(self.bridge.words(GNSS, self.time_s, [WORD] * BLOCK))

    def heartbeat(self) -> None:
        body = racklink.heartbeat([(GNSS, self.words, 0)])
        self.say(self.bridge.packet(f.HEARTBEAT, GNSS, self.time_s, body))


class CanSay:
    """The same words and heartbeats as CAN frames; their packets are read for what they are about."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.us = 0

    def __call__(self, packet: bytes) -> None:
        body = cobs.decode(packet[:-1])[16:-4]
        if len(body) == 8 * BLOCK:
            for _ in range(BLOCK):
                self.us += 360
                self._send(0, WORD & 0xFF, struct.pack("<II", WORD, self.us))
        elif len(body) == 9:
            self._send(2, 0, body[1:])

    def _send(self, kind: int, index: int, data: bytes) -> None:
        identifier = f.CAN_PREFIX << 24 | GNSS << 16 | kind << 12 | index
        self.bus.send(can.Message(arbitration_id=identifier, data=data))


@dataclass
class Bench:
    """A gateway on three lines, and who speaks on each."""

    live: Live
    senders: list[Sender]
    disk: Disk

    @property
    def counters(self) -> dict[str, int]:
        (summary,) = self.live.events("summary")
        return dict(summary["counters"])

    def lost(self) -> dict[str, int]:
        """By line, the words that did not arrive."""
        return {s.name: s.words - self.counters[f"{s.name}.words_429"] for s in self.senders}

    def stall(self, blocks: int) -> None:
        """Speak before, during and after the disk stands still; then say how much was said."""
        for sender in self.senders:
            sender.heartbeat()
            sender.block()
        wait_until(lambda: len(self.live.events("status", state="UP")) == len(self.senders), "all up")
        self.disk.orders.set()
        for sender in self.senders:
            sender.block()
        wait_until(self.disk.stalled.is_set, "the stall")
        began = time.monotonic()
        for _ in range(blocks):
            for sender in self.senders:
                sender.block()
        assert time.monotonic() - began < STALL_S
        time.sleep(STALL_S - (time.monotonic() - began))
        for sender in self.senders:
            sender.block()
            sender.heartbeat()


@contextmanager
def running(rack: Callable[..., Live], disk: Disk) -> Iterator[Bench]:
    port = free_port()
    channel = {str(GNSS): {"kind": "arinc429", "definitions": "gnss_743a"}}
    with (
        PtyOutlet() as line,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams,
        can.Bus("stall", "virtual") as bus,
    ):
        adapters = [
            {"name": name, "source": source, "channels": channel}
            for name, source in (("tty", line.place), ("lan", f"udp:127.0.0.1:{port}"), ("bus", "can:virtual:stall"))
        ]
        with rack(adapters) as live:
            wait_until(lambda: len(live.events("status", state="UP")) == len(adapters), "all up")
            senders = [
                Sender("tty", line.write),
                Sender("lan", lambda packet: _datagram(datagrams, packet, port)),
                Sender("bus", CanSay(bus)),
            ]
            yield Bench(live, senders, disk)


def _datagram(line: socket.socket, packet: bytes, port: int) -> None:
    line.sendto(cobs.decode(packet[:-1]), ("127.0.0.1", port))


def test_within_the_queue_s_size_nothing_is_lost(make_rack: MakeRack, monkeypatch: pytest.MonkeyPatch) -> None:
    with running(lambda adapters: Live(make_rack(adapters=adapters)), Disk(monkeypatch)) as bench:
        bench.stall(blocks=200)
        wait_until(lambda: len(bench.live.events("state")) > 0, "time goes on")
    assert bench.lost() == {"tty": 0, "lan": 0, "bus": 0}
    assert not [name for name, count in bench.counters.items() if name.endswith("_dropped") and count]
    assert {bench.counters[f"{sender.name}.words_lost_on_link"] for sender in bench.senders} == {0}


def test_beyond_it_every_word_is_counted_and_the_verdict_says_so(
    make_rack: MakeRack, monkeypatch: pytest.MonkeyPatch
) -> None:
    def rack(adapters: list[dict[str, object]]) -> Live:
        config = make_rack(adapters=adapters, terrain=[TERRAIN])
        recording = config.recording and config.recording.model_copy(update={"queue_mib": 1})
        return Live(config.model_copy(update={"recording": recording}))

    with running(rack, Disk(monkeypatch)) as bench:
        bench.stall(blocks=1000)
        bench.senders[0].say(bench.senders[0].bridge.hello() + sweep(bench.senders[0].bridge, 20.0))
        bench.live.wait_for("scan")
        bench.live.wait_for("integrity")
    lost, counters = bench.lost(), bench.counters
    assert sum(lost.values()) > 0
    assert lost == {name: counters[f"{name}.words_lost_on_link"] for name in lost}
    units = {"tty": "bytes", "lan": "datagrams", "bus": "frames"}
    told = json.dumps([event["reasons"] for event in bench.live.events("integrity")])
    for name, count in lost.items():
        dropped = counters.get(f"{name}.{units[name]}_dropped", 0)
        assert bool(dropped) == bool(count)
        assert not count or f"degraded: {name}: {count} words lost on the link" in told
        assert not count or f"degraded: {name}: {dropped} {units[name]} dropped" in told
