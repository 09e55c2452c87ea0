"""What gateway tests share: one short flight, and racks that listen to it."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

from gateway.config import RackConfig, check_config
from gateway.warmup import warm_up_words
from simulators.carriers import stream as stream_carrier
from simulators.link import units
from simulators.scenario import BUILT_IN_TERRAIN, Scenario, white_mountains

# The first example of a run may compile a kernel, so a time limit on an example would measure the compiler.
settings.register_profile("compiled", deadline=None)
settings.load_profile("compiled")

TERRAIN = BUILT_IN_TERRAIN["white_mountains"]
MakeRack = Callable[..., RackConfig]


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    """What a live gateway compiles at its first start ever, it must not compile while a test waits for words."""
    warm_up_words()


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """Ten seconds over the mountains with a radial each three degrees: two whole sweeps and a begun one."""
    plan = white_mountains(10.0, seed=5)
    return plan.model_copy(update={"radar": plan.radar.model_copy(update={"step_deg": 3.0})})


@pytest.fixture(scope="session")
def flight(scenario: Scenario) -> list[tuple[int, bytes]]:
    """The encoded packets of the flight, each with its device time."""
    return list(units(scenario, stream_carrier()))


@pytest.fixture(scope="session")
def stream(flight: list[tuple[int, bytes]]) -> bytes:
    """The flight as one byte stream."""
    return b"".join(packet for _, packet in flight)


@pytest.fixture
def make_rack(tmp_path: Path) -> MakeRack:
    """A rack with one adapter named `bridge` that records below the test's directory."""

    def make(source: str = "serial:/dev/null", **changes: object) -> RackConfig:
        table: dict[str, object] = {
            "adapters": [{"name": "bridge", "source": source}],
            "recording": {"directory": tmp_path / "recordings"},
        }
        return check_config({**table, **changes}, "test")

    return make


@pytest.fixture
def signals_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A verb that runs in this process must not take the signals of the tests."""
    monkeypatch.setattr("gateway.stopping.signal.signal", lambda *_: None)
