"""What is plugged in is listed with the source that a rack file needs; what is not there is said."""

import errno
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
import usb.core
from serial.tools.list_ports_common import ListPortInfo
from typer.testing import CliRunner

from gateway import devices
from gateway.adapters import make_adapter
from gateway.adapters.usb import UsbAdapter
from gateway.cli import app
from gateway.config import AdapterConfig
from gateway.devices import Device, can_devices, plugged_in, serial_lines, usb_bridges
from simulators.outlets.usb import Handle, Plug, UsbBackend, UsbDevice
from tests.gateway.machine import interface


class Locked(UsbBackend):
    """Bridges that this user may not open."""

    def open_device(self, dev: Plug) -> Handle:
        raise usb.core.USBError("Access denied", -3, errno.EACCES)


class Described(UsbBackend):
    """Devices whose descriptor says something else."""

    said: ClassVar[dict[str, int]] = {}

    def get_device_descriptor(self, dev: Plug) -> SimpleNamespace:
        return SimpleNamespace(**{**vars(super().get_device_descriptor(dev)), **self.said})


class Keyboards(Described):
    said: ClassVar = {"idVendor": 0x046D, "idProduct": 0xC31C}


class Unnumbered(Described):
    said: ClassVar = {"iSerialNumber": 0}


def port(device: str, **said: object) -> ListPortInfo:
    info = ListPortInfo(device)
    for name, value in said.items():
        setattr(info, name, value)
    return info


def test_a_serial_line_goes_by_the_name_that_lasts(tmp_path: Path) -> None:
    names = tmp_path / "dev/serial/by-id"
    names.mkdir(parents=True)
    (tmp_path / "dev/ttyUSB0").touch()
    (names / "usb-FTDI_A5-if00-port0").symlink_to("../../ttyUSB0")
    adapter = port(str(tmp_path / "dev/ttyUSB0"), vid=0x0403, pid=0x6001, serial_number="A5", description="FT232R")
    assert serial_lines([adapter], tmp_path) == [
        Device(f"serial:{names}/usb-FTDI_A5-if00-port0", "0403:6001", "A5", "FT232R")
    ]


def test_a_serial_line_without_a_lasting_name_goes_by_its_device(tmp_path: Path) -> None:
    assert serial_lines([port("/dev/ttyS0", description="ttyS0")], tmp_path) == [
        Device("serial:/dev/ttyS0", "", "", "")
    ]


def test_a_bridge_on_usb_goes_by_its_serial_number() -> None:
    assert usb_bridges(UsbBackend([UsbDevice("S-42"), UsbDevice("S-43")])) == [
        Device("usb:1209:7080:S-42", "1209:7080", "S-42", "simulated bridge"),
        Device("usb:1209:7080:S-43", "1209:7080", "S-43", "simulated bridge"),
    ]


def test_a_serial_number_with_a_slash_is_written_so_that_the_adapter_reads_it() -> None:
    (found,) = usb_bridges(UsbBackend([UsbDevice("7/a: 50%")]))
    adapter = make_adapter(AdapterConfig(name="bridge", source=found.source))
    assert isinstance(adapter, UsbAdapter)
    assert (adapter.serial, adapter.interface) == ("7/a: 50%", None)


def test_a_bridge_without_a_serial_number_goes_by_its_kind() -> None:
    assert usb_bridges(Unnumbered([UsbDevice()])) == [Device("usb:1209:7080", "1209:7080", "", "simulated bridge")]


def test_other_devices_on_usb_are_left_out() -> None:
    assert usb_bridges(Keyboards([UsbDevice()])) == []


def test_a_bridge_that_may_not_be_opened_is_listed_with_the_reason() -> None:
    (found,) = usb_bridges(Locked([UsbDevice()]))
    assert found == Device("usb:1209:7080", "1209:7080", "", "no permission to ask for more: see `shadebus doctor`")


def test_without_libusb_there_is_no_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("libusb_package.get_libusb1_backend", lambda: None)
    assert usb_bridges() == []


def test_can_interfaces_are_listed_by_name_and_state(tmp_path: Path) -> None:
    interface(tmp_path, "eth0", kind=1)
    interface(tmp_path, "can1", 0x40)
    interface(tmp_path, "can0", mtu=72)
    interface(tmp_path, "can2", carrier=0)
    assert can_devices(tmp_path) == [
        Device("can:socketcan:can0", "", "", "up, FD"),
        Device("can:socketcan:can1", "", "", "down, classic"),
        Device("can:socketcan:can2", "", "", "bus off, classic"),
    ]


@pytest.fixture
def nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    monkeypatch.setattr(devices, "usb_bridges", list)
    monkeypatch.setattr(devices, "can_interfaces", lambda root: [])


@pytest.mark.usefixtures("nothing")
def test_what_is_not_there_is_said_kind_by_kind(tmp_path: Path) -> None:
    said = ["no serial line is plugged in", "this machine shows no USB bus", "there is no CAN interface"]
    assert plugged_in(tmp_path) == ([], said)
    (tmp_path / "dev/bus/usb").mkdir(parents=True)
    assert plugged_in(tmp_path)[1][1] == "no USB bridge (1209:7080) is plugged in"


@pytest.mark.usefixtures("nothing")
def test_the_verb_with_nothing_plugged_in_prints_that_beside_its_output() -> None:
    for arguments in (["devices"], ["devices", "--json"]):
        done = CliRunner().invoke(app, arguments)
        assert (done.exit_code, done.stdout) == (0, "")
        assert "there is no CAN interface" in done.stderr.splitlines()


def test_the_verb_prints_a_table_or_json_lines_of_sources_that_a_rack_file_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interface(tmp_path, "can0")
    found: tuple[list[Device], list[str]] = ([*usb_bridges(UsbBackend([UsbDevice()])), *can_devices(tmp_path)], [])
    monkeypatch.setattr(devices, "plugged_in", lambda: found)
    lines: list[dict[str, Any]] = list(
        map(json.loads, CliRunner().invoke(app, ["devices", "--json"]).stdout.splitlines())
    )
    assert [Device(**line) for line in lines] == found[0]
    for line in lines:
        make_adapter(AdapterConfig(name="bridge", source=line["source"]))
    table = CliRunner().invoke(app, ["devices"]).stdout
    assert all(one.source in table for one in found[0])
