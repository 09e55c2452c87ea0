"""A simulated USB bridge through pyusb itself."""

import errno
import threading
from array import array
from typing import Any

import pytest
import usb.core
import usb.util

from simulators import carriers
from simulators.ledger import Ledger
from simulators.outlets import Closed
from simulators.outlets.usb import PACKET_BYTES, PRODUCT, VENDOR, UsbBackend, UsbDevice
from simulators.racklink import Packet
from tests.simulators.small_bridge import heard, timed_packets

ENDPOINT = 0x81


def find(*devices: UsbDevice, **match: Any) -> Any:
    return usb.core.find(idVendor=0x1209, idProduct=0x7080, backend=UsbBackend(devices), **match)


def opened(device: UsbDevice) -> Any:
    host = find(device)
    host.set_configuration()
    usb.util.claim_interface(host, 0)
    return host


def error_of(host: Any, size: int = 4096) -> int | None:
    with pytest.raises(usb.core.USBError) as raised:
        host.read(ENDPOINT, size, 10)
    code = raised.value.errno
    assert code is None or isinstance(code, int)
    return code


def test_pyusb_finds_one_vendor_interface_with_one_bulk_endpoint_towards_the_host() -> None:
    host = find(UsbDevice("BR-7"))
    (configuration,) = host
    (interface,) = configuration
    (endpoint,) = interface
    assert (host.idVendor, host.idProduct, host.serial_number) == (VENDOR, PRODUCT, "BR-7")
    assert (host.manufacturer, host.product) == ("shadebus", "simulated bridge")
    assert (interface.bInterfaceClass, endpoint.bEndpointAddress, endpoint.wMaxPacketSize) == (0xFF, 0x81, 512)
    assert usb.util.endpoint_type(endpoint.bmAttributes) == usb.util.ENDPOINT_TYPE_BULK


def test_descriptors_past_the_end_are_index_errors() -> None:
    device = UsbDevice()
    backend = UsbBackend([device])
    (plug,) = backend.enumerate_devices()
    for ask, numbers in (
        (backend.get_configuration_descriptor, (1,)),
        (backend.get_interface_descriptor, (1, 0, 0)),
        (backend.get_interface_descriptor, (0, 1, 0)),
        (backend.get_endpoint_descriptor, (1, 0, 0, 0)),
    ):
        with pytest.raises(IndexError):
            ask(plug, *numbers)


def test_two_bridges_are_told_apart_by_their_serial_numbers() -> None:
    one, two = UsbDevice("one", address=1), UsbDevice("two", address=2)
    assert find(one, two, serial_number="two").address == 2
    assert [host.address for host in find(one, two, find_all=True)] == [1, 2]


def test_reads_give_what_was_written_and_then_time_out() -> None:
    device = UsbDevice()
    host = opened(device)
    device.write(b"abc")
    device.write(bytes(1000))
    assert bytes(host.read(ENDPOINT, 512, 100)) == b"abc" + bytes(509)
    assert len(host.read(ENDPOINT, 4096, 100)) == 491
    with pytest.raises(usb.core.USBTimeoutError) as raised:
        host.read(ENDPOINT, 512, 10)
    assert raised.value.errno == errno.ETIMEDOUT == 110


def test_a_read_fills_the_array_that_it_was_given() -> None:
    device = UsbDevice()
    host = opened(device)
    device.write(b"abc")
    buffer = array("B", bytes(512))
    assert host.read(ENDPOINT, buffer, 100) == 3
    assert buffer[:4].tobytes() == b"abc\0"


def test_a_read_waits_for_the_first_bytes() -> None:
    device = UsbDevice()
    host = opened(device)
    threading.Timer(0.05, device.write, [b"late"]).start()
    assert bytes(host.read(ENDPOINT, 512, 5000)) == b"late"


def test_a_stall_lasts_until_the_host_clears_it() -> None:
    device = UsbDevice()
    host = opened(device)
    device.write(b"abc")
    device.stall()
    assert (error_of(host), error_of(host)) == (errno.EPIPE, errno.EPIPE)
    host.clear_halt(ENDPOINT)
    assert bytes(host.read(ENDPOINT, 512, 100)) == b"abc"


def test_an_overflow_costs_one_packet() -> None:
    device = UsbDevice()
    host = opened(device)
    device.write(bytes(512) + b"abc")
    device.overflow()
    assert error_of(host) == errno.EOVERFLOW
    assert bytes(host.read(ENDPOINT, 512, 100)) == b"abc"


def test_a_read_of_no_whole_number_of_packets_overflows_when_more_comes() -> None:
    device = UsbDevice()
    host = opened(device)
    device.write(bytes(512))
    assert error_of(host, 100) == errno.EOVERFLOW


@pytest.mark.parametrize("code", [errno.ENODEV, errno.EIO])
def test_unplugging_ends_a_read_under_way_and_the_device_is_no_longer_there(code: int) -> None:
    device = UsbDevice()
    host = opened(device)
    threading.Timer(0.05, device.unplug, [code]).start()
    with pytest.raises(usb.core.USBError) as raised:
        host.read(ENDPOINT, 512, 5000)
    assert raised.value.errno == code
    assert find(device) is None
    device.write(b"vanishes")
    usb.util.dispose_resources(host)


def test_a_device_that_comes_back_has_another_address_and_old_handles_stay_dead() -> None:
    device = UsbDevice(address=5)
    host = opened(device)
    device.write(b"before")
    device.unplug()
    device.replug()
    device.write(b"after")
    assert error_of(host) == errno.ENODEV
    again = opened(device)
    assert again.address == 6
    assert bytes(again.read(ENDPOINT, 512, 100)) == b"after"


def test_a_second_program_cannot_claim_the_interface() -> None:
    device = UsbDevice()
    host = opened(device)
    with pytest.raises(usb.core.USBError) as raised:
        opened(device)
    assert raised.value.errno == errno.EBUSY
    usb.util.dispose_resources(host)
    opened(device)


def test_nothing_can_be_written_to_the_bridge() -> None:
    device = UsbDevice()
    host = opened(device)
    with pytest.raises(ValueError, match="endpoint"):
        host.write(0x01, b"abc")
    with pytest.raises(NotImplementedError):
        host.write(ENDPOINT, b"abc")
    with pytest.raises(usb.core.USBError):
        host.ctrl_transfer(0x40, 1, 0, 0, b"abc")


def test_a_packet_that_finds_the_fifo_full_is_lost_in_the_device_and_the_ledger_tells() -> None:
    ledger = Ledger()
    device = UsbDevice(fifo_bytes=100)
    device.on_lost = ledger.lose_frame
    packet = Packet(0x10, 1, 0, 0, 0, bytes(8 * 5))  # 5 words
    (frame,) = carriers.stream().units(packet)
    for _ in range(4):
        ledger.carry(1, 0x10, 5)
        device.write(frame)
    assert len(frame) == 62
    assert ledger.lost == {(1, 0x10): 15}
    assert ledger.counts(1) == (5, 15)
    assert ledger.overflowed == {1}
    assert bytes(opened(device).read(ENDPOINT, 8 * PACKET_BYTES, 100)) == frame


@pytest.mark.parametrize("spoilt", [b"", b"\0", b"\7abc\0", b"\1\1\1\0"])
def test_a_spoilt_packet_that_finds_the_fifo_full_counts_as_lost_on_the_link(spoilt: bytes) -> None:
    ledger = Ledger()
    (frame,) = carriers.stream().units(Packet(0x10, 1, 0, 0, 0, bytes(8)))
    for lost in (spoilt, frame[:10], frame[:-2] + b"\x55\0"):
        ledger.lose_frame(lost)
    assert ledger == Ledger()


def test_the_heartbeats_of_a_bridge_whose_fifo_overflows_are_right_to_the_word() -> None:
    ledger = Ledger()
    device = UsbDevice(fifo_bytes=2000)
    device.on_lost = ledger.lose_frame
    host = opened(device)
    carrier = carriers.stream()
    came = b""
    for number, (_, packet) in enumerate(timed_packets(ledger=ledger)):
        for frame in carrier.units(packet):
            device.write(frame)
        if number > 100:  # the host reads late
            came += bytes(host.read(ENDPOINT, 4096, 100))
    words, counts = heard([came], "stream")
    assert sum(lost for _, lost in counts.values()) > 100
    for channel, (received, lost) in counts.items():
        assert words[channel] == received
        assert received + lost == sum(count for (number, _), count in ledger.carried.items() if number == channel)


def test_closing_waits_for_the_reader_and_then_pulls_the_plug() -> None:
    device = UsbDevice()
    host = opened(device)
    device.write(b"last")
    threading.Timer(0.05, lambda: host.read(ENDPOINT, 512, 100)).start()
    device.close()
    assert error_of(host) == errno.ENODEV
    with pytest.raises(Closed):
        device.write(b"x")
