"""A USB serial adapter of the FTDI kind, as QEMU makes it, with the kernel's real driver."""

import os
from pathlib import Path

from tests.rig import words
from tests.rig.machine import modprobe
from tests.rig.watched import Watched, wait_until

PORTS = Path("/sys/class/virtio-ports")
LATENCY_MS = Path("/sys/bus/usb-serial/devices/ttyUSB0/latency_timer")


def far_end() -> int:
    """The other end of the line, which the machine has as a virtio port."""
    (name,) = [path for path in PORTS.glob("*/name") if path.read_text() == "ftdi\n"]
    return os.open(f"/dev/{name.parent.name}", os.O_WRONLY)


def test_every_packet_comes_through_an_ftdi_adapter_that_hands_bytes_over_at_once() -> None:
    modprobe("xhci_pci", "ftdi_sio")
    wait_until(LATENCY_MS.exists, lambda: "no FTDI adapter")
    with Watched("serial:/dev/ttyUSB0") as watched:
        watched.wait_up()
        assert LATENCY_MS.read_text() == "1\n"
        line = far_end()
        for number in range(200):
            os.write(line, words.packet(number))
        watched.wait_packets(200)
        os.close(line)
    assert watched.sequences == [*range(200)]
    assert watched.words == [word for number in range(200) for word in words.words(number)]
