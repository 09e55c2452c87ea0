"""Serial lines through pyserial: devices, `socket://` and `rfc2217://`."""

import contextlib
import errno

import serial

from gateway.config import AdapterConfig
from gateway.errors import GatewayError

LONGEST_WAIT_S = 0.2  # so that a silent line still notices the order to stop
SOCKET_WAIT_S = 0.01  # a socket's read waits for its full size, so this is the latency of a trickle
LARGEST_READ = 65_536

MENDS = {
    errno.ENOENT: "no such device: plug it in, or see `ls /dev/serial/by-id` for its name",
    errno.EACCES: "no permission: add yourself to the dialout group, or see `shadebus doctor`",
    errno.EBUSY: "in use: another program holds the line",
    errno.ENOTTY: "not a serial line",
    errno.ECONNREFUSED: "connection refused: nothing listens at that address",
}


class SerialPort:
    """An open line. The read idiom depends on the kind: `in_waiting` counts on a device and is useless on a socket."""

    def __init__(self, line: serial.Serial, *, is_socket: bool) -> None:
        self._line = line
        self._is_socket = is_socket

    def read(self) -> bytes:
        """Whatever has come, up to 64 KiB."""
        size = LARGEST_READ if self._is_socket else min(self._line.in_waiting or 1, LARGEST_READ)
        return bytes(self._line.read(size))

    def close(self) -> None:
        """Close the line; an unplugged one may object in many ways, none of which matters any more."""
        with contextlib.suppress(Exception):
            self._line.close()


class SerialAdapter:
    """A serial line by device path or pyserial URL."""

    def __init__(self, address: str, baud: int) -> None:
        self.address = address
        self.baud = baud

    def open(self) -> SerialPort:
        """Open the line for this process alone. Raises GatewayError with the mend."""
        is_socket = self.address.startswith("socket://")
        is_device = "://" not in self.address
        timeout_s = SOCKET_WAIT_S if is_socket else LONGEST_WAIT_S
        try:
            line = serial.serial_for_url(
                self.address, baudrate=self.baud, timeout=timeout_s, exclusive=is_device or None
            )
        except (OSError, ValueError) as error:
            number = getattr(error, "errno", None) or getattr(error.__context__, "errno", None)
            raise GatewayError(f"serial line {self.address}: {MENDS.get(number or 0, error)}") from error
        return SerialPort(line, is_socket=is_socket)


def make(address: str, config: AdapterConfig) -> SerialAdapter:
    """The adapter of a `serial:` source."""
    return SerialAdapter(address, config.baud)
