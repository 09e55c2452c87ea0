"""One short recorded flight for all exports, and a way to export in this process."""

import signal
from pathlib import Path

import pytest

from gateway.exports import export
from gateway.stopping import Stop
from simulators.scenario import Scenario
from tests.gateway.exports.recorded import Flown, To, fly


@pytest.fixture(scope="session")
def stop() -> Stop:
    """A Stop that this process's signals do not set."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    made = Stop(patience_s=None)
    for number, handler in before.items():
        signal.signal(number, handler)
    return made


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory, scenario: Scenario, flight: list[tuple[int, bytes]]) -> Flown:
    """The flight of the gateway's tests as a recording, and what was sent."""
    return fly(tmp_path_factory.mktemp("flown") / "flight.mcap", scenario, flight)


@pytest.fixture
def to(stop: Stop, tmp_path: Path) -> To:
    """Export a recording to a format below the test's directory: the path, and what is said."""

    def run(recording: Path, form: str, *, name: str = "out", without_terrain: bool = False) -> tuple[Path, list[str]]:
        path = tmp_path / name
        return path, export(recording, form, path, stop, without_terrain=without_terrain)

    return run
