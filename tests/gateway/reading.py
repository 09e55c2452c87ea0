"""Read a port by hand, as the supervisor does."""

from gateway.adapters import Port, Reading, make_adapter
from gateway.config import AdapterConfig
from tests.gateway.live import wait_until


def open_source(source: str) -> Port:
    """The open port of a source."""
    return make_adapter(AdapterConfig(name="bridge", source=source)).open()


def read_units(port: Port, units: int) -> list[Reading]:
    """The readings until so many units have come."""
    readings: list[Reading] = []

    def enough() -> bool:
        readings.append(port.read())
        return sum(reading.units for reading in readings) >= units

    wait_until(enough, f"{units} units")
    return readings


def data_of(readings: list[Reading]) -> bytes:
    """What the readings gave together."""
    return b"".join(reading.data for reading in readings)
