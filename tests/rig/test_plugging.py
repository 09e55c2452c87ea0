"""Devices that are pulled out in mid-stream and put back: what was under way is lost and counted, and nothing else."""

import contextlib
import os
import threading
import tty
from collections.abc import Callable, Iterator

import pytest

from tests.rig import words
from tests.rig.can_links import slcan_text, write_line
from tests.rig.functionfs import BulkBridge, bulk_bridge
from tests.rig.gadget import Gadget, serial_line
from tests.rig.watched import DEADLINE_S, Watched, wait_until
from tests.rig.words import frames

GATEWAY_SIDE, BRIDGE_SIDE = "/dev/ttyACM0", "/dev/ttyGS0"
Send = Callable[[bytes], object]


class Feeder(threading.Thread):
    """Sends numbered packets until it is told to stop or its device is pulled out; `next` is the next number."""

    def __init__(self, send: Send, first: int) -> None:
        super().__init__(daemon=True)
        self.next = first
        self._send = send
        self._stopping = threading.Event()

    def run(self) -> None:
        with contextlib.suppress(OSError):  # pulled out
            while not self._stopping.is_set():
                self.next += 1
                self._send(words.packet(self.next - 1))

    def stop(self) -> None:
        self._stopping.set()
        self.join(DEADLINE_S)
        assert not self.is_alive()


@contextlib.contextmanager
def bridge_side() -> Iterator[int]:
    """The bridge's own end of the serial line, which has to be opened anew after each plugging in."""
    line = os.open(BRIDGE_SIDE, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(line)
        yield line
    finally:
        os.close(line)


def commands(line: int) -> list[str]:
    """What a serial CAN bridge is told until it opens its bus."""
    said = b""
    while not said.endswith(b"O\r"):
        said += os.read(line, 100)
    return said.decode().split("\r")


@contextlib.contextmanager
def sender(device: Gadget | BulkBridge) -> Iterator[Send]:
    if isinstance(device, BulkBridge):
        yield device.send
    else:
        with bridge_side() as line:
            yield lambda data: os.write(line, data)


@pytest.mark.parametrize(
    ("source", "device"),
    [
        (f"serial:{GATEWAY_SIDE}", serial_line),
        ("serial:hwgrep://1209:7081", serial_line),
        ("usb:1209:7080", bulk_bridge),
        ("usb:1209:7080:bulk-1", bulk_bridge),
    ],
)
def test_unplugging_in_mid_stream_loses_only_what_was_under_way_and_counts_it(
    source: str, device: Callable[[], contextlib.AbstractContextManager[Gadget | BulkBridge]]
) -> None:
    with device() as bridge, Watched(source) as watched:
        watched.wait_up()
        with sender(bridge) as send:
            before = Feeder(send, 0)
            before.start()
            watched.wait_packets(200)
            bridge.unplug()
            before.stop()
        watched.wait_lost()
        arrived = len(watched.sequences)
        bridge.plug()
        watched.wait_up(2)
        with sender(bridge) as send:
            after = Feeder(send, before.next)
            after.start()
            watched.wait_packets(arrived + 200)
            after.stop()
            wait_until(lambda: watched.sequences[-1] == after.next - 1, lambda: f"the last packet: {watched.states}")

    back = watched.sequences[arrived]
    assert watched.sequences == [*range(arrived), *range(back, after.next)]
    assert arrived <= back <= before.next
    assert watched.link.counters["packets_lost"] == back - arrived
    assert watched.words == [word for number in watched.sequences for word in words.words(number)]


def test_a_device_that_is_not_there_yet_is_opened_once_it_is_plugged_in() -> None:
    with bulk_bridge() as bridge:
        bridge.unplug()
        with Watched("usb:1209:7080") as watched:
            watched.wait_lost()
            bridge.plug()
            watched.wait_up()
            bridge.send(words.packet(0))
            watched.wait_packets(1)
    assert "no such device" in watched.reasons[0]


def test_a_device_is_told_from_its_twin_by_its_serial_number() -> None:
    with bulk_bridge("bulk-2") as bridge, Watched("usb:1209:7080:bulk-1") as watched:
        watched.wait_lost()
    assert "no such device" in watched.reasons[0]
    assert bridge is not None


def test_a_serial_can_bridge_is_told_to_open_its_bus_again_after_it_was_unplugged() -> None:
    with serial_line() as gadget, contextlib.ExitStack() as stack:
        with bridge_side() as line:
            watched = stack.enter_context(Watched(f"can:slcan:{GATEWAY_SIDE}?bitrate=1000000"))
            assert commands(line)[:2] == ["C", "S8"]  # close, 1 Mbit/s
            watched.wait_up()
            write_line(line, slcan_text(frames(range(50))))
            watched.wait_words(50)
            gadget.unplug()
        watched.wait_lost()
        gadget.plug()
        with bridge_side() as line:
            assert commands(line)[:2] == ["C", "S8"]  # close, 1 Mbit/s
            watched.wait_up(2)
            write_line(line, slcan_text(frames(range(50, 100))))
            watched.wait_words(100)
    assert watched.words == [words.word(number) for number in range(100)]
