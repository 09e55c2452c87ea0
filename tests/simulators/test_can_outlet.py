"""A simulated bridge as a node of a CAN bus, read with python-can."""

import threading

import can
import pytest

from simulators.carriers import Frame
from simulators.outlets import Closed
from simulators.outlets.canbus import CanOutlet
from simulators.player import play

CLASSIC = [Frame(0x16000000 + k, bytes([k % 256] * (k % 9)), False) for k in range(500)]
FLEXIBLE = [Frame(0x16001000 + k, bytes([k] * 64), True) for k in range(50)]
BUSES = {
    "virtual": {"interface": "virtual", "channel": "rack"},
    "udp_multicast": {"interface": "udp_multicast", "channel": "239.74.163.7"},
}


def heard(bus: can.BusABC, count: int) -> list[Frame]:
    messages = [bus.recv(5) for _ in range(count)]
    return [Frame(m.arbitration_id, bytes(m.data), m.is_fd) for m in messages if m and m.is_extended_id]


@pytest.mark.parametrize("name", BUSES)
@pytest.mark.parametrize(("frames", "fd"), [(CLASSIC[:50], False), (FLEXIBLE, True)])
def test_another_node_of_the_bus_hears_every_frame(name: str, frames: list[Frame], fd: bool) -> None:
    place = BUSES[name]
    with can.Bus(**place, fd=fd, hop_limit=0) as reader, CanOutlet(**place, fd=fd) as outlet:  # type: ignore[arg-type]
        for frame in frames:
            outlet.write(frame)
        assert heard(reader, len(frames)) == frames
    assert outlet.place == f"can:{place['interface']}:{place['channel']}" + "?fd=true" * fd


def test_a_full_receive_queue_makes_the_sender_wait_and_loses_nothing() -> None:
    with can.Bus("narrow", "virtual", rx_queue_size=3) as reader, CanOutlet("virtual", "narrow") as outlet:
        sender = threading.Thread(target=play, args=([(0, frame) for frame in CLASSIC], outlet))
        sender.start()
        frames = heard(reader, len(CLASSIC))
        sender.join(10)
    assert frames == CLASSIC


def test_a_node_that_waits_for_nobody_is_released_by_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simulators.outlets.canbus.STALL_S", 0.1)
    stalls: list[str] = []
    with can.Bus("dead", "virtual", rx_queue_size=1):
        outlet = CanOutlet("virtual", "dead")

        def stalled() -> None:
            stalls.append("once")
            threading.Thread(target=outlet.close).start()

        outlet.on_stall = stalled
        outlet.write(CLASSIC[0])
        with pytest.raises(Closed):
            outlet.write(CLASSIC[1])
    assert stalls == ["once"]


def test_an_interface_that_nobody_knows_is_refused() -> None:
    with pytest.raises(ValueError, match="tin"):
        CanOutlet("tin", "can0")


def test_a_bus_that_is_not_there_is_an_error_of_the_system() -> None:
    with pytest.raises(OSError, match=r"none0|No such device|not supported"):
        CanOutlet("socketcan", "none0")
