"""The kernel's CAN interfaces through the gateway's adapter: every frame, every loss, and interfaces that come and go."""

import pytest

from gateway.adapters import make_adapter
from gateway.adapters import socketcan as adapter_module
from gateway.config import AdapterConfig
from tests.rig import words
from tests.rig.can_links import CLASSIC_MTU, PORTS, ip, linked_ports, send, slcan, slcan_text, vcan, write_line
from tests.rig.watched import Watched, recorded_frames
from tests.rig.words import frames, radar_frames, radar_word

VCAN = "can:socketcan:vcan0"


def said(numbers: range) -> list[int]:
    return [words.word(number) for number in numbers]


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
    with vcan():
        port = make_adapter(AdapterConfig(name="bridge", source=VCAN)).open()
        send("vcan0", frames(range(2000)))
        kept = port.read()
        send("vcan0", frames([2000]))  # the kernel tells of losses beside the next frame
        last = port.read()
        port.close()
    assert 0 < kept.units < 2000
    assert recorded_frames(kept.data) == frames(range(kept.units))
    assert (last.units, kept.units + kept.lost + last.lost) == (1, 2000)


def test_losses_while_the_reader_works_are_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter_module, "RECEIVE_BYTES", 4096)
    with vcan(), Watched(VCAN) as watched:
        watched.wait_up()
        send("vcan0", frames(range(3000)))
        watched.wait_words(1)
        send("vcan0", frames([3000]))
        watched.wait_words(3001 - watched.lost)
    assert watched.words[-1] == words.word(3000)
    assert len(watched.words) + watched.lost == 3001


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
    with vcan():
        port = make_adapter(AdapterConfig(name="bridge", source=VCAN)).open()
        send("vcan0", frames(range(50)))
        if end == "down":
            ip("set", "vcan0", "down")
        else:
            ip("del", "vcan0")
            ip("add", "vcan0", "type", "vcan")  # another of the same name, for the leaving to delete
        assert recorded_frames(port.read().data) == frames(range(50))
        with pytest.raises(OSError, match="."):
            port.read()
        port.close()


def test_two_controllers_on_one_bus() -> None:
    with linked_ports(), Watched(f"can:socketcan:{PORTS[1]}") as watched:
        watched.wait_up()
        send(PORTS[0], frames(range(300)))
        watched.wait_words(300)
        ip("set", PORTS[1], "down")
        watched.wait_lost()
        ip("set", PORTS[1], "up")
        watched.wait_up(2)
        send(PORTS[0], frames(range(300, 320)))
        watched.wait_words(320)
    assert recorded_frames(watched.recorded) == frames(range(320))
    assert watched.words == said(range(320))


def test_a_serial_can_bridge_behind_the_kernel_s_own_interface() -> None:
    with slcan() as (name, bridge), Watched(f"can:socketcan:{name}") as watched:
        watched.wait_up()
        write_line(bridge, slcan_text(frames(range(150))))
        write_line(bridge, b"\xff\x07Tgarbage\r")
        write_line(bridge, slcan_text(frames(range(150, 300))))
        watched.wait_words(300)
    assert recorded_frames(watched.recorded) == frames(range(300))
    assert watched.words == said(range(300))
