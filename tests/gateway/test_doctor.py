"""Each check of the doctor finds its lack in a made-up machine and prints the command that mends it."""

import ctypes
import grp
import os
from pathlib import Path

import pytest

from gateway.doctor import clock, disk, examine, network, serial, usb
from gateway.doctor.clock import KernelClock
from tests.gateway.machine import bridge, controller, interface, put


def test_a_bare_machine_lacks_no_device(tmp_path: Path) -> None:
    found = {one.check: one for one in examine(tmp_path, tmp_path)}
    none = ("serial latency", "USB permission", "CAN interfaces")
    assert [(found[name].good, found[name].seen) for name in none] == [
        (True, "no FTDI adapter"),
        (True, "no bridge (1209:7080)"),
        (True, "none"),
    ]


def test_an_adapter_that_gathers_bytes_is_told_not_to_for_ever(tmp_path: Path) -> None:
    put(tmp_path, "sys/bus/usb-serial/devices/ttyUSB0", latency_timer=16)
    put(tmp_path, "sys/bus/usb-serial/devices/ttyUSB1", latency_timer=1)
    found = serial.latency(tmp_path)
    assert (found.good, found.seen) == (False, "ttyUSB0 waits 16 ms, ttyUSB1 waits 1 ms")
    assert found.mend == (
        """echo 'ACTION=="add|change", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'"""
        " | sudo tee /etc/udev/rules.d/70-shadebus-latency.rules"
        " && sudo udevadm control --reload && sudo udevadm trigger"
    )
    put(tmp_path, "sys/bus/usb-serial/devices/ttyUSB0", latency_timer=1)
    assert serial.latency(tmp_path).good


def test_an_adapter_without_a_latency_timer_is_none_of_ftdi(tmp_path: Path) -> None:
    put(tmp_path, "sys/bus/usb-serial/devices/ttyUSB0")
    assert serial.latency(tmp_path) == ("serial latency", True, "no FTDI adapter", serial.latency(tmp_path).mend)


def test_a_bridge_that_root_alone_may_open_gets_a_rule(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bridge(tmp_path)
    bridge(tmp_path, "1-2", vendor="1d6b", device=8)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(grp, "getgrgid", lambda number: grp.struct_group(("root", "x", 0, [])))
    found = usb.permission(tmp_path)
    assert (found.good, found.seen) == (False, "/dev/bus/usb/001/007")
    assert found.mend == (
        """echo 'SUBSYSTEM=="usb", ATTR{idVendor}=="1209", ATTR{idProduct}=="7080", GROUP="dialout", MODE="0660"'"""
        " | sudo tee /etc/udev/rules.d/70-shadebus-usb.rules"
        " && sudo udevadm control --reload && sudo udevadm trigger"
        " && sudo usermod -aG dialout $USER, then log in again"
    )


def test_a_bridge_of_another_group_asks_to_join_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bridge(tmp_path)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(grp, "getgrgid", lambda number: grp.struct_group(("plugdev", "x", 46, [])))
    assert usb.permission(tmp_path).mend == "sudo usermod -aG plugdev $USER, then log in again"


def test_a_bridge_that_can_be_opened_is_good(tmp_path: Path) -> None:
    bridge(tmp_path)
    assert usb.permission(tmp_path)[:3] == ("USB permission", True, "1 can be opened")


def test_small_socket_buffers_are_named_with_the_setting_that_lasts(tmp_path: Path) -> None:
    put(tmp_path, "proc/sys/net/core", rmem_max=212_992, rmem_default=212_992)
    found = network.socket_buffers(tmp_path)
    assert (found.good, found.seen) == (False, "rmem_max 212992, rmem_default 212992")
    assert found.mend == (
        r"printf 'net.core.rmem_max = 4194304\n' | sudo tee /etc/sysctl.d/70-shadebus.conf"
        " && sudo sysctl --load=/etc/sysctl.d/70-shadebus.conf"
    )
    put(tmp_path, "proc/sys/net/core", rmem_max=4 << 20, rmem_default=65_536)
    found = network.socket_buffers(tmp_path)
    assert not found.good
    assert r"'net.core.rmem_default = 212992\n'" in found.mend
    put(tmp_path, "proc/sys/net/core", rmem_max=8 << 20, rmem_default=212_992)
    assert network.socket_buffers(tmp_path).good


def test_socket_buffers_that_a_container_hides_are_not_taken_for_good(tmp_path: Path) -> None:
    found = network.socket_buffers(tmp_path)
    assert (found.good, found.seen) == (False, "rmem_max hidden, rmem_default hidden")


@pytest.mark.parametrize(
    ("flags", "carrier", "queue", "mend"),
    [
        (0x41, 1, 1000, ""),
        (0x41, 1, 10, "sudo ip link set can0 txqueuelen 256"),
        (0x41, 0, 1000, "sudo ip link set can0 type can restart"),
        (0x41, 0, 10, "sudo ip link set can0 type can restart && sudo ip link set can0 txqueuelen 256"),
        (0x40, 1, 1000, "sudo ip link set can0 up type can bitrate 1000000" + network.RATE),
        (0x40, 1, 10, "sudo ip link set can0 up txqueuelen 256 type can bitrate 1000000" + network.RATE),
    ],
)
def test_a_can_interface_is_mended_by_its_state(
    flags: int, carrier: int, queue: int, mend: str, tmp_path: Path
) -> None:
    interface(tmp_path, "can0", flags, carrier, queue=queue)
    controller(tmp_path, "can0")
    found = network.can(tmp_path)
    assert (found.good, found.mend) == (not mend, mend)


def test_a_virtual_can_interface_has_no_bit_rate_and_an_ethernet_one_is_none_of_ours(tmp_path: Path) -> None:
    interface(tmp_path, "eth0", kind=1)
    interface(tmp_path, "vcan0", 0x40)
    interface(tmp_path, "vcan1")
    found = network.can(tmp_path)
    assert found.seen == "vcan0 down, queue of 1000, vcan1 up, queue of 1000"
    assert found.mend == "sudo ip link set vcan0 up"


def test_the_kernel_says_of_its_clock_what_adjtimex_says() -> None:
    assert clock.synchronised(KernelClock(0, 0x2001, 12_345))[:3] == ("clock", True, "synchronised to 12.3 ms")
    for unsynchronised in (KernelClock(5, 0x2001, 0), KernelClock(0, 0x40, 0)):
        found = clock.synchronised(unsynchronised)
        assert not found.good
        assert found.mend.startswith("sudo apt install chrony")


def test_the_kernel_is_asked_by_a_structure_as_large_as_its_own() -> None:
    assert ctypes.sizeof(clock._Timex) >= 208
    try:
        said = clock.kernel_clock()
    except OSError as error:
        pytest.skip(f"this sandbox hides the kernel's clock: {error}")
    assert 0 <= said.state <= 5
    assert (said.state == 5) >= bool(said.status & 0x40)
    assert 0 <= said.largest_error_us <= 2**31


def test_a_kernel_that_does_not_answer_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> KernelClock:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(clock, "kernel_clock", refused)
    assert clock.host_clock()[:3] == ("clock", False, "the kernel does not say: Operation not permitted")


def test_a_disk_is_measured_for_small_and_for_long_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk, "_seconds", lambda file, mib: {1: 0.1, 8: 0.5}[mib])
    assert disk.writes(tmp_path)[:3] == ("disk writes", True, "1 MiB synchronised in 100.0 ms, 8 MiB at 16 MiB/s")
    monkeypatch.setattr(disk, "_seconds", lambda file, mib: {1: 0.1, 8: 4.0}[mib])
    assert not disk.writes(tmp_path).good
    monkeypatch.setattr(disk, "_seconds", lambda file, mib: {1: 0.6, 8: 0.5}[mib])
    assert not disk.writes(tmp_path).good


def test_a_recording_directory_that_is_not_there_yet_is_measured_where_it_will_be(tmp_path: Path) -> None:
    assert disk.room(tmp_path / "new" / "er").seen.endswith(f"free at {tmp_path}")
    assert disk.writes(tmp_path / "new").seen.startswith("1 MiB synchronised in ")
    assert list(tmp_path.iterdir()) == []
