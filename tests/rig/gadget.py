"""USB devices that the guest's kernel plays itself, on a host controller without wires: configfs and dummy_hcd."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from tests.rig.machine import modprobe

CONTROLLER = "dummy_udc.0"
GADGETS = Path("/sys/kernel/config/usb_gadget")
ENGLISH = "0x409"


class Gadget:
    """One device; `function` is what it is, such as `acm.line`."""

    def __init__(self, vendor: int, product: int, serial_number: str, function: str) -> None:
        self._path = GADGETS / f"{vendor:04x}_{product:04x}"
        self._function = self._path / "functions" / function
        self._configuration = self._path / "configs" / "c.1"
        self._link = self._configuration / function
        self._strings = self._path / "strings" / ENGLISH
        for directory in (self._path, self._function, self._configuration, self._strings):
            directory.mkdir(parents=True)
        self._write("idVendor", f"{vendor:#06x}")
        self._write("idProduct", f"{product:#06x}")
        self._write(f"strings/{ENGLISH}/serialnumber", serial_number)
        self._write(f"strings/{ENGLISH}/product", "bus bridge")
        self._link.symlink_to(self._function)

    def plug(self) -> None:
        """Put it into the socket."""
        self._write("UDC", CONTROLLER)

    def unplug(self) -> None:
        """Pull it out, whether or not it is in."""
        if (self._path / "UDC").read_text().strip():
            self._write("UDC", "\n")

    def remove(self) -> None:
        """Take it to pieces, in the order that configfs asks for."""
        self.unplug()
        self._link.unlink()
        for directory in (self._strings, self._configuration, self._function, self._path):
            directory.rmdir()

    def _write(self, name: str, value: str) -> None:
        (self._path / name).write_text(value)  # closes the file, so that what the kernel objects to is raised


@contextlib.contextmanager
def serial_line(serial_number: str = "line-1") -> Iterator[Gadget]:
    """A CDC-ACM bridge, plugged in: the gateway's side is /dev/ttyACM0, the bridge's own /dev/ttyGS0."""
    modprobe("dummy_hcd", "libcomposite", "usb_f_acm", "cdc_acm")
    gadget = Gadget(0x1209, 0x7081, serial_number, "acm.line")
    gadget.plug()
    try:
        yield gadget
    finally:
        gadget.remove()
