"""Every kind of line under every fault that it can have: what is good arrives, and all else is counted to the word.

The bridges of a line, one for each fault, speak to one gateway at the same time: no fault may touch another line.
"""

import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import pytest

from decoders.framing import Packet
from gateway.adapters import usb as usb_adapter
from gateway.config import AdapterConfig, check_config
from gateway.framing import form_of
from simulators import carriers
from simulators.faults import device, link, plug, through
from simulators.ledger import Ledger
from simulators.outlets import PtyOutlet, SlcanOutlet, TcpOutlet, UdpOutlet
from simulators.outlets.canbus import CanOutlet
from simulators.outlets.usb import UsbBackend, UsbDevice
from simulators.player import play
from simulators.scenario import LinkFault
from tests.gateway.live import Live, raw_records, wait_until
from tests.gateway.test_udp import free_port
from tests.simulators.small_bridge import SECONDS, sent

START_S, STOP_S = 0.555, 0.945
RECOVERY_S = 2.0
CHANNELS = {
    "0": {"kind": "arinc708"},
    "1": {"kind": "arinc429", "definitions": "iru_704"},
    "2": {"kind": "arinc429", "definitions": "gnss_743a"},
}
SETTINGS: Mapping[str, dict[str, float]] = {
    "lost": {"chance": 0.3},
    "doubled": {"chance": 0.3},
    "truncated": {"chance": 0.3},
    "bit_flips": {"chance": 0.3},
    "wrong_crc": {"chance": 0.3},
    "parity_errors": {"chance": 0.5},
    "word_length_errors": {"chance": 0.5},
    "fifo_overflow": {"chance": 0.5},
    "clock_jump": {"clock_s": 4000.0},
}


class Line(NamedTuple):
    """A kind of line: an outlet of it by a number and a directory, its carrier, and the gateway's name for it."""

    outlet: Callable[[int, Path], Any]
    carrier: Callable[[], carriers.Carrier[Any]]
    source: Callable[[Any], str] = lambda outlet: str(outlet.place)
    at_once: int = 20


LINES = {
    "tty": Line(lambda k, place: PtyOutlet(place / f"tty{k}"), carriers.stream),
    "tcp": Line(lambda _k, _: TcpOutlet(), carriers.stream),
    "usb": Line(lambda k, _: UsbDevice(f"S{k}"), carriers.stream, lambda usb: f"usb:1209:7080:{usb.serial_number}"),
    "udp": Line(lambda _k, _: UdpOutlet("127.0.0.1", free_port()), carriers.datagram),
    "can": Line(lambda k, _: CanOutlet("virtual", f"matrix{k}"), carriers.can, at_once=6),
    "can_fd": Line(lambda k, _: CanOutlet("virtual", f"matrix{k}", fd=True), partial(carriers.can, fd=True)),
    "slcan": Line(lambda k, place: SlcanOutlet(place / f"can{k}"), carriers.slcan, at_once=8),
}


@dataclass
class Bridge:
    """One line with one fault, and what came of it."""

    fault: LinkFault
    outlet: Any
    source: str
    ledger: Ledger = field(default_factory=Ledger)
    counters: dict[str, int] = field(default_factory=dict)
    arrived: list[tuple[float, Packet]] = field(default_factory=list)  # host time of reading in s

    @property
    def config(self) -> AdapterConfig:
        return AdapterConfig.model_validate({"name": self.fault.name, "source": self.source, "channels": CHANNELS})

    def play(self, carrier: carriers.Carrier[Any]) -> None:
        units = sent(carrier, [self.fault], self.ledger)
        play(through(iter(units), [self.fault], plug.FAULTS, seed=1), self.outlet)

    def read(self, recording: Path) -> None:
        framer = form_of(self.config).framer()
        for record in raw_records(recording):
            if record.adapter == self.fault.name:
                time_s = record.stamp.monotonic_ns / 1e9
                self.arrived += [(time_s, packet) for packet in framer.feed(record.data)]

    def radar_words(self) -> dict[int, tuple[float, bytes]]:
        """By number, when each whole radar word came, and the word."""
        words = [(time_s, packet.body[2:]) for time_s, packet in self.arrived if packet.type == 0x20]
        return {struct.unpack_from("<I", word)[0]: (time_s, word) for time_s, word in words if len(word) == 200}


def faults_of(name: str) -> list[str]:
    line = LINES[name]
    carrier = line.carrier().name
    can_be_unplugged = name not in {"udp", "can", "can_fd"}
    return sorted({*device.FAULTS, *link.FAULTS[carrier], *(plug.FAULTS if can_be_unplugged else ())})


MATRIX = [(name, fault) for name in LINES for fault in faults_of(name)]


@pytest.fixture(scope="module")
def bridges(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str, str], Bridge]]:
    """The bridge of a line with a fault; those of one line run together, when the first is asked for."""
    done: dict[tuple[str, str], Bridge] = {}

    def bridge(name: str, fault: str) -> Bridge:
        if (name, fault) not in done:
            names = faults_of(name)
            at_once = LINES[name].at_once
            start = names.index(fault) // at_once * at_once
            for ran in run(LINES[name], names[start : start + at_once], tmp_path_factory.mktemp(name)):
                done[name, ran.fault.name] = ran
        return done[name, fault]

    yield bridge


def run(line: Line, faults: list[str], place: Path) -> list[Bridge]:
    with ExitStack() as stack:
        bridges = []
        for number, fault in enumerate(faults):
            outlet = stack.enter_context(line.outlet(number, place))
            settings = {"name": fault, "start_s": START_S, "stop_s": STOP_S, **SETTINGS.get(fault, {})}
            bridges.append(Bridge(LinkFault.model_validate(settings), outlet, line.source(outlet)))
        outlets = [bridge.outlet for bridge in bridges]
        stack.enter_context(patch.object(usb_adapter, "get_backend", lambda: UsbBackend(outlets)))
        table: dict[str, object] = {
            "adapters": [bridge.config.model_dump() for bridge in bridges],
            "recording": {"directory": place},
        }
        with Live(check_config(table, "matrix")) as live:
            wait_until(lambda: len(live.events("status", state="UP")) >= len(bridges), "all up")
            threads = [threading.Thread(target=bridge.play, args=(line.carrier(),)) for bridge in bridges]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            for outlet in outlets:
                getattr(outlet, "drain", lambda: None)()  # or a slow reader would be stopped before the last words
            enough = max(SECONDS, len(live.events("state")) + 1)
            wait_until(lambda: len(live.events("state")) > enough, "the last words are heard")
        (summary,) = live.events("summary")
        for bridge in bridges:
            prefix = f"{bridge.fault.name}."
            found = summary["counters"].items()
            bridge.counters = {key.removeprefix(prefix): count for key, count in found if key.startswith(prefix)}
            bridge.read(live.path)
    return bridges


@pytest.mark.parametrize(("line", "fault"), MATRIX)
def test_every_word_sent_has_arrived_or_is_counted_as_lost(
    bridges: Callable[[str, str], Bridge], line: str, fault: str
) -> None:
    bridge = bridges(line, fault)
    counters = bridge.counters
    for (channel, _), carried in bridge.ledger.carried.items():
        books = [counters[f"channel_{channel}.words{where}"] for where in ("", "_lost_on_link", "_lost_in_bridge")]
        assert sum(books) == carried
    assert counters["received"] == counters["framed"] + counters["skipped"] + counters["pending"]


@pytest.mark.parametrize(("line", "fault"), MATRIX)
def test_good_words_before_and_after_the_fault_are_all_there(
    bridges: Callable[[str, str], Bridge], line: str, fault: str
) -> None:
    words = bridges(line, fault).radar_words()
    back_s = STOP_S + (RECOVERY_S if fault == "unplug" else 0)
    good = [k for k in range(0, 100 * SECONDS, 2) if not START_S <= (k + 1) / 100 < back_s]
    assert [k for k in good if words.get(k, (0, b""))[1] != struct.pack("<I", k) * 50] == []


@pytest.mark.parametrize(("line", "fault"), MATRIX)
def test_the_next_good_word_is_decoded_within_two_seconds(
    bridges: Callable[[str, str], Bridge], line: str, fault: str
) -> None:
    words = bridges(line, fault).radar_words()
    times = {k: time_s - (k + 1) / 100 for k, (time_s, _) in words.items()}
    began_s = min(lateness for k, lateness in times.items() if (k + 1) / 100 < START_S)
    next_one = min(k for k in words if (k + 1) / 100 >= STOP_S)
    assert words[next_one][0] - began_s - STOP_S < RECOVERY_S


@pytest.mark.parametrize(("line", "fault"), [pair for pair in MATRIX if pair[0] in {"tty", "tcp", "usb", "udp"}])
def test_no_altered_word_is_taken_for_a_good_one(bridges: Callable[[str, str], Bridge], line: str, fault: str) -> None:
    words = bridges(line, fault).radar_words()
    assert [k for k, (_, word) in words.items() if word != struct.pack("<I", k) * 50] == []
