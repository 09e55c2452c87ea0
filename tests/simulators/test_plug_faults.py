"""A plug that is pulled out in the middle of a packet and put in again."""

from pathlib import Path

import pytest
import serial
import usb.core

from simulators import carriers, scenario
from simulators.faults.plug import Plug, plugged
from simulators.outlets import PtyOutlet, TcpOutlet
from simulators.outlets.usb import UsbBackend, UsbDevice
from simulators.player import play
from simulators.scenario import LinkFault
from tests.simulators.small_bridge import SECOND_NS, heard, sent

UNITS = [(SECOND_NS * k, b"unit %d," % k) for k in range(6)]


def plan(*windows: tuple[float, float]) -> scenario.Scenario:
    faults = tuple(LinkFault(name="unplug", start_s=start, stop_s=stop) for start, stop in windows)
    return scenario.white_mountains().model_copy(update={"link_faults": faults})


def test_the_unit_under_way_is_cut_in_the_middle_and_the_plug_goes_in_again_when_its_time_has_come() -> None:
    assert list(plugged(iter(UNITS), plan((1.5, 3.5)))) == [
        *UNITS[:2],
        (2 * SECOND_NS, b"uni"),
        (2 * SECOND_NS, Plug.OUT),
        UNITS[3],
        (3_500_000_000, Plug.IN),
        *UNITS[4:],
    ]


def test_a_plug_may_be_pulled_more_than_once_and_stay_out_at_the_end() -> None:
    found = [unit for _, unit in plugged(iter(UNITS), plan((1, 2), (4, float("inf"))))]
    assert found == [b"unit 0,", b"uni", Plug.OUT, Plug.IN, b"unit 2,", b"unit 3,", b"uni", Plug.OUT, b"unit 5,"]


def test_frames_are_never_cut() -> None:
    frames = [(ready, unit) for ready, unit in sent(carriers.can()) if ready < SECOND_NS]
    found = [unit for _, unit in plugged(iter(frames), plan((0.5, 0.6)))]
    assert found.count(Plug.OUT) == found.count(Plug.IN) == 1
    assert len(found) == len(frames) + 1


def test_played_to_a_pseudo_terminal_it_leaves_the_reader_without_a_line_and_the_link_leads_to_the_next(
    tmp_path: Path,
) -> None:
    link = tmp_path / "bridge"
    items = list(plugged(iter(UNITS), plan((2, 4))))
    out, back = ([unit for _, unit in items].index(plug) for plug in (Plug.OUT, Plug.IN))
    with PtyOutlet(link) as outlet:
        with serial.Serial(str(link), timeout=5) as host:
            play(items[:out], outlet, speed=float("inf"))
            assert host.read(17) == b"unit 0,unit 1,uni"
            play(items[out:back], outlet, speed=float("inf"))
            with pytest.raises((serial.SerialException, OSError)):
                host.read(1)
        assert not link.exists()
        play(items[back : back + 1], outlet, speed=float("inf"))
        with serial.Serial(str(link), timeout=5) as host:
            play(items[back + 1 :], outlet, speed=float("inf"))
            assert host.read(14) == b"unit 4,unit 5,"


def test_played_to_a_tcp_client_it_ends_the_connection_and_lets_the_next_one_in() -> None:
    with TcpOutlet() as outlet:
        url = outlet.place.removeprefix("serial:")
        with serial.serial_for_url(url, timeout=5) as host:
            outlet.write(b"before")
            assert host.read(6) == b"before"
            outlet.unplug()
            outlet.write(b"vanishes")
            with pytest.raises(serial.SerialException):
                host.read(1)
        with pytest.raises(serial.SerialException):
            serial.serial_for_url(url)
        outlet.replug()
        with serial.serial_for_url(url, timeout=5) as host:
            outlet.write(b"after")
            assert host.read(5) == b"after"


def test_played_to_a_usb_device_it_leaves_the_bus_and_comes_back_with_another_address() -> None:
    device = UsbDevice(fifo_bytes=10**6)
    units = plugged(iter(sent(carriers.stream())), plan((1, 2)))
    play((pair for pair in units if pair[1] is not Plug.IN), device, speed=float("inf"))
    assert usb.core.find(backend=UsbBackend([device])) is None
    device.replug()
    frames = [(ready, unit) for ready, unit in sent(carriers.stream()) if ready >= 2 * SECOND_NS]
    play(frames, device, speed=float("inf"))
    host = usb.core.find(backend=UsbBackend([device]))
    assert host.address == 2
    data = bytes(host.read(0x81, 10**6 // 512 * 512, 100))
    assert heard([data], "stream") == heard([unit for _, unit in frames], "stream")
