"""Real pyusb code on a pretend wire: which device is opened, and what each trouble of the endpoint means."""

import errno
from collections.abc import Iterator

import pytest
import usb.core

from gateway.adapters import Port
from gateway.adapters import usb as adapter
from gateway.config import AdapterConfig
from gateway.errors import GatewayError
from simulators.outlets.usb import UsbBackend, UsbDevice
from tests.gateway.reading import data_of, open_source, read_units

CONFIG = AdapterConfig(name="bridge", source="usb:1209:7080")


@pytest.fixture
def devices(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[UsbDevice]]:
    plugged = [UsbDevice("A1")]
    monkeypatch.setattr(adapter, "get_backend", lambda: UsbBackend(plugged))
    yield plugged
    for device in plugged:
        device.unplug()


@pytest.fixture
def port(devices: list[UsbDevice]) -> Iterator[Port]:
    line = open_source("usb:1209:7080")
    yield line
    line.close()


def test_every_byte_comes_in_large_reads(devices: list[UsbDevice], port: Port) -> None:
    sent = bytes(range(256)) * 200
    devices[0].write(sent)
    readings = read_units(port, len(sent))
    assert data_of(readings) == sent
    assert max(reading.units for reading in readings) == 32 * 512


def test_a_silent_device_gives_nothing_after_a_short_wait(port: Port) -> None:
    assert (port.read().data, port.read().remark) == (b"", "")


def test_a_stall_is_cleared_told_and_costs_nothing(devices: list[UsbDevice], port: Port) -> None:
    devices[0].stall()
    devices[0].write(b"words")
    readings = read_units(port, 5)
    assert data_of(readings) == b"words"
    assert [reading.remark for reading in readings if reading.remark] == ["the endpoint had stalled and goes on"]


def test_an_endpoint_that_only_stalls_is_given_up(devices: list[UsbDevice], port: Port) -> None:
    for _ in range(adapter.MOST_STALLS):
        devices[0].stall()
        assert port.read().remark
    devices[0].stall()
    with pytest.raises(usb.core.USBError) as caught:
        port.read()
    assert caught.value.errno == errno.EPIPE


def test_an_overflow_is_told_and_the_line_goes_on(devices: list[UsbDevice], port: Port) -> None:
    devices[0].overflow()
    assert port.read().remark == "the device sent more than a packet holds; what it sent is lost"
    devices[0].write(b"words")
    assert data_of(read_units(port, 5)) == b"words"


@pytest.mark.parametrize("error", [errno.ENODEV, errno.EIO])
def test_unplugging_loses_the_line_and_replugging_brings_it_back(
    devices: list[UsbDevice], port: Port, error: int
) -> None:
    devices[0].unplug(error)
    with pytest.raises(usb.core.USBError):
        port.read()
    port.close()
    with pytest.raises(GatewayError, match="usb 1209:7080: no such device: plug it in"):
        open_source("usb:1209:7080")
    devices[0].replug()
    again = open_source("usb:1209:7080")
    devices[0].write(b"words")
    assert data_of(read_units(again, 5)) == b"words"
    again.close()


def test_of_several_devices_the_serial_number_tells_which(devices: list[UsbDevice]) -> None:
    devices.append(UsbDevice("B2", address=9))
    with pytest.raises(GatewayError, match="2 such devices: add the serial number"):
        open_source("usb:1209:7080")
    line = open_source("usb:1209:7080:B2/0")
    devices[0].write(b"no")
    devices[1].write(b"yes")
    assert data_of(read_units(line, 3)) == b"yes"
    line.close()


def test_an_interface_in_use_is_named_with_the_mend(port: Port) -> None:
    with pytest.raises(GatewayError, match="usb 1209:7080: in use: another program holds the interface"):
        open_source("usb:1209:7080")


def test_a_device_without_the_interface_is_named(devices: list[UsbDevice]) -> None:
    assert devices
    with pytest.raises(GatewayError, match="usb 1209:7080: no interface number 3 has a bulk IN endpoint"):
        open_source("usb:1209:7080/3")


@pytest.mark.parametrize("address", ["", "1209", "1209:", "12x9:7080", "1209:7080/x"])
def test_an_address_that_cannot_be_one_is_refused_with_what_to_write(address: str) -> None:
    with pytest.raises(GatewayError, match="write usb:VID:PID, as in usb:1209:7080"):
        adapter.make(address, CONFIG)


def test_a_serial_number_may_hold_any_character() -> None:
    assert adapter.make("1209:7080:A%2FB:C", CONFIG).serial == "A/B:C"
