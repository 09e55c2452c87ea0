"""The kernel's CAN interfaces through the adapter: every frame, every loss, and interfaces that come and go."""

import contextlib
from collections.abc import Iterator

import pytest

from gateway.adapters import Port, make_adapter
from gateway.adapters import socketcan as adapter_module
from gateway.config import AdapterConfig
from tests.rig import words
from tests.rig.can_links import CLASSIC_MTU, PORTS, ip, linked_ports, send, slcan, slcan_text, vcan, write_line
from tests.rig.watched import Watched, recorded_frames, wait_until
from tests.rig.words import Frame, frames, radar_frames, radar_word

BUS_OFF = Frame(0x2000_0040, bytes(8))  # as the kernel gives it of a controller
FIFO = 4  # frames that an SJA1000 controller holds; an emulated machine may not take them out in time for more
VCAN = "can:socketcan:vcan0"


def said(numbers: range) -> list[int]:
    return [words.word(number) for number in numbers]


@contextlib.contextmanager
def open_port() -> Iterator[Port]:
    """The adapter's port alone, which reads only when it is told to."""
    port = make_adapter(AdapterConfig(name="bridge", source=VCAN)).open()
    try:
        yield port
    finally:
        port.close()


def test_every_classic_frame_arrives_as_it_was_sent() -> None:
    sent = frames(range(500))
    with vcan(mtu=CLASSIC_MTU), Watched(VCAN) as watched:
        watched.wait_up()
        send("vcan0", sent)
        watched.wait_words(500)
    assert recorded_frames(watched.recorded) == sent
    assert watched.words == said(range(500))
    assert watched.lost == 0


def test_fd_frames_of_radar_words_arrive_beside_classic_ones() -> None:
    radar = [frame for number in range(60) for frame in radar_frames(number)]
    with vcan(), Watched(f"{VCAN}?fd=true") as watched:
        watched.wait_up()
        send("vcan0", radar, fd=True)
        send("vcan0", frames(range(100)))
        watched.wait_words(100)
    assert recorded_frames(watched.recorded) == radar + frames(range(100))
    assert watched.radar_words == [radar_word(number) for number in range(60)]
    assert watched.words == said(range(100))


def test_what_an_idle_reader_has_no_room_for_is_counted_frame_by_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter_module, "RECEIVE_BYTES", 4096)
    with vcan(), open_port() as port:
        send("vcan0", frames(range(2000)))
        first = port.read()
        send("vcan0", frames([2000]))
        second = port.read()
    assert 0 < first.units < 2000
    assert first.units + first.lost == 2000
    assert recorded_frames(first.data) == frames(range(first.units))
    assert (recorded_frames(second.data), second.lost) == (frames([2000]), 0)


def test_losses_while_the_reader_works_are_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter_module, "RECEIVE_BYTES", 4096)
    with vcan(), Watched(VCAN) as watched:
        watched.wait_up()
        send("vcan0", frames(range(3000)))
        wait_until(lambda: len(watched.words) + watched.lost == 3000, lambda: f"{len(watched.words)} + {watched.lost}")
    assert watched.lost > 0
    assert watched.words == [word for word in said(range(3000)) if word in set(watched.words)]


def test_an_interface_that_is_deleted_is_lost_until_it_is_back() -> None:
    with Watched(VCAN) as watched:
        watched.wait_lost()
        with vcan():
            watched.wait_up()
            send("vcan0", frames(range(20)))
            watched.wait_words(20)
        watched.wait_lost()
        with vcan():
            watched.wait_up(2)
            send("vcan0", frames(range(20, 40)))
            watched.wait_words(40)
    assert watched.words == said(range(40))
    assert "no such interface" in watched.reasons[0]


def test_an_interface_that_is_set_down_is_lost_until_it_is_up_again() -> None:
    with vcan(), Watched(VCAN) as watched:
        watched.wait_up()
        send("vcan0", frames(range(20)))
        watched.wait_words(20)
        ip("set", "vcan0", "down")
        watched.wait_lost()
        ip("set", "vcan0", "up")
        watched.wait_up(2)
        send("vcan0", frames(range(20, 40)))
        watched.wait_words(40)
    assert watched.words == said(range(40))


@pytest.mark.parametrize("end", ["down", "delete"])
def test_frames_that_wait_when_an_interface_ends_are_still_given(end: str) -> None:
    with vcan(), open_port() as port:
        send("vcan0", frames(range(50)))
        if end == "down":
            ip("set", "vcan0", "down")
        else:
            ip("del", "vcan0")
            ip("add", "vcan0", "type", "vcan")  # another of the same name, for the leaving to delete
        assert recorded_frames(port.read().data) == frames(range(50))
        with pytest.raises(OSError, match=r"\[Errno"):
            port.read()


def test_two_controllers_on_one_bus() -> None:
    with linked_ports(), Watched(f"can:socketcan:{PORTS[1]}") as watched:
        watched.wait_up()
        for count in range(0, 300, FIFO):
            send(PORTS[0], frames(range(count, count + FIFO)))
            watched.wait_words(count + FIFO)
        ip("set", PORTS[1], "down")
        watched.wait_lost()
        ip("set", PORTS[1], "up")
        watched.wait_up(2)
        send(PORTS[0], frames(range(300, 303)))
        watched.wait_words(303)
    assert recorded_frames(watched.recorded) == frames(range(303))
    assert watched.words == said(range(303))


def test_a_serial_can_bridge_behind_the_kernel_s_own_interface() -> None:
    with slcan() as (name, bridge), Watched(f"can:socketcan:{name}") as watched:
        watched.wait_up()
        write_line(bridge, slcan_text(frames(range(150))))
        write_line(bridge, b"\xff\x07Tgarbage\r")
        write_line(bridge, slcan_text(frames(range(150, 300))))
        watched.wait_words(300)
    assert recorded_frames(watched.recorded) == frames(range(300))
    assert watched.words == said(range(300))


def test_frames_that_a_controller_has_no_room_for_are_counted() -> None:
    with linked_ports(), Watched(f"can:socketcan:{PORTS[1]}") as watched:
        watched.wait_up()

        def overflowed() -> bool:
            send(PORTS[0], frames(range(300)))  # until the emulated machine is too slow for the controller once
            return watched.lost > 0

        wait_until(overflowed, lambda: "no overflow told")
    assert watched.link.all_counters()["error_frames"] == watched.lost


def test_a_controller_that_leaves_the_bus_is_told_and_its_frames_before_and_after_are_kept() -> None:
    with vcan(), Watched(VCAN) as watched:
        watched.wait_up()
        send("vcan0", frames(range(5)))
        send("vcan0", [BUS_OFF])
        send("vcan0", frames(range(5, 10)))
        watched.wait_words(10)
    assert watched.words == said(range(10))
    assert watched.states == ["OPENING", "UP", "UP", "CLOSED"]
    assert "off the bus" in watched.reasons[0]
