"""Settings and real terrain for the monitor's tests."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

from monitor import terrain
from monitor.scans import Scan
from monitor.terrain import Terrain, WideTerrain, open_terrain
from tests.monitor.scanning import honest_scan

# The first example of a run may compile a kernel, so a time limit on an example would measure the compiler.
settings.register_profile("compiled", deadline=None)
settings.load_profile("compiled")

ROOT = Path(__file__).parents[2]
Opened = Callable[[Path | list[Path]], Terrain]


@pytest.fixture(scope="session")
def white_mountains_path() -> Path:
    return ROOT / "simulators/data/terrain/N44W072.hgt"


@pytest.fixture(scope="session")
def sierra_path() -> Path:
    return ROOT / "tests/data/terrain/sierra_nevada_1arcsec_wgs84.tif"


@pytest.fixture(scope="session")
def sao_tome_path() -> Path:
    return ROOT / "tests/data/terrain/n00_e006_3arc_v2.dt1"


@pytest.fixture(scope="session")
def white_mountains(white_mountains_path: Path) -> Terrain:
    return open_terrain(white_mountains_path)


@pytest.fixture(scope="session")
def sierra(sierra_path: Path) -> Terrain:
    return open_terrain(sierra_path)


@pytest.fixture(scope="session")
def honest(white_mountains: Terrain) -> Scan:
    """A scan that agrees with the terrain to the bin."""
    return honest_scan(white_mountains)


@pytest.fixture(params=["whole", "wide"])
def opened(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Opened:
    """Opens files as terrain that is held, or as if they were too large to be."""
    if request.param == "wide":
        monkeypatch.setattr(terrain, "WHOLE_POSTS", 0)
        monkeypatch.setattr(terrain, "BLOCK_DEG", 0.125)

    def checked(paths: Path | list[Path]) -> Terrain:
        found = open_terrain(paths)
        assert isinstance(found, WideTerrain) == (request.param == "wide")
        return found

    return checked
