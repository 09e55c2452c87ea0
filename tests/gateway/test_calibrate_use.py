"""Calibrations of flights by a rack file: its settings and its water decide, and a monitor uses what came out."""

import json
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gateway.calibrate.radar import calibration, material
from gateway.calibrate.recorded import Read, read
from gateway.cli import app
from gateway.config import RackConfig, check_config
from gateway.events import Event, IntegrityEvent
from gateway.metadata import build_monitor
from gateway.recording import Recorder, Recording
from gateway.recording.session import file_of_session
from gateway.replay import replay
from gateway.reprocess.job import jobs
from monitor.calibration import Calibration, load_calibration
from simulators.scenario import BUILT_IN_TERRAIN
from tests.gateway.flown import record_flight

MOUNTAINS = BUILT_IN_TERRAIN["white_mountains"]
SWEEPS = 5
FIRST, SECOND = "flight1", "flight2"
ADAPTER = {"name": "bridge", "source": "serial:x"}
# Other shadows, other pairs, and other tests of them.
SETTINGS: list[dict[str, object]] = [
    {},
    {"minimum_size": 1},
    {"minimum_size": 12},
    {"pairing": "first"},
    {"method": "paper"},
    {"shift_budget": 0.9, "unmatched_dem_budget": 0.05},
]


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("flights")
    for seed, name in enumerate((FIRST, SECOND), 1):
        record_flight(directory / f"{name}.mcap", seed, SWEEPS)
    return directory


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All that lies west of a meridian which the flights have on both sides."""
    west, south, east, north = -72.1, 43.9, -71.72, 45.1
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    path = tmp_path_factory.mktemp("water") / "lake.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


def rack(**sections: object) -> RackConfig:
    table = {"adapters": [ADAPTER], "terrain": [MOUNTAINS], **sections}
    return check_config(table, "test")


def reads(directory: Path, config: RackConfig | None) -> list[Read]:
    return [read(job) for job in jobs(directory, config, ())]


def verdicts(path: Path, config: RackConfig, made: Calibration | None = None) -> Iterator[IntegrityEvent]:
    """What a replay says; of `made` instead of the configured calibration."""
    events: list[Event] = []
    failures: list[str] = []
    replay(Recording(path), config, build_monitor(config, made), events.append, failures.append)
    assert not failures
    return (event for event in events if isinstance(event, IntegrityEvent))


def test_each_checked_rate_is_how_often_a_monitor_of_these_settings_alerts(flights: Path) -> None:
    """The first flight is fitted, the second checked; what the radar's gain is does not enter into a rate."""
    found = []
    for settings in SETTINGS:
        config = rack(monitor={**settings, "p_fa": 0.45, "offset_search_m": 0})
        given = reads(flights, config)
        made = calibration("made", given, material(given), 2 * SWEEPS)
        of_any_gain = made.model_copy(update={"level": None})
        alerts = []
        for rate in made.checked:
            asked = config.model_copy(update={"monitor": config.monitor.model_copy(update={"p_fa": rate.p_fa})})
            told = [verdict.verdict for verdict in verdicts(flights / f"{SECOND}.mcap", asked, of_any_gain)]
            assert (rate.scans, len(told)) == (SWEEPS, SWEEPS)
            alerts.append((rate.p_fa, told.count("alert")))
        assert [(rate.p_fa, rate.alerts) for rate in made.checked] == alerts
        found.append(alerts)
    assert [p_fa for p_fa, _ in found[0]] == [0.45, 0.1, 0.01, 0.001]
    assert len(set(map(tuple, found))) > 2, "or the settings make no difference, and this test says nothing"


def test_shadows_over_the_water_of_the_configuration_take_no_part(flights: Path, lake: Path, tmp_path: Path) -> None:
    """Whether a rack file or the user names the water, or the recordings were made with it; and as in flight."""
    wet = rack(water=[lake])
    record_flight(tmp_path / f"{FIRST}.mcap", 1, SWEEPS, water=[lake])
    dry, given, recorded = (
        [scan.sample.disparities.tolist() for scan in one.scans]
        for one in (reads(flights, rack())[0], reads(flights, wet)[0], reads(tmp_path, None)[0])
    )
    assert given == recorded
    assert all(0 < len(some) < len(every) for some, every in zip(given, dry, strict=True))
    for one in (reads(flights, wet)[0], *map(read, jobs(flights / f"{FIRST}.mcap", None, (), [lake]))):
        assert [scan.sample.disparities.tolist() for scan in one.scans] == given
        terrain, water = (f"{zlib.crc32(path.read_bytes()):08x}" for path in (MOUNTAINS, lake))
        assert one.terrain == f"N44W072.hgt (checksum {terrain}) without water lake.geojson (checksum {water})"
    in_flight = [verdict.n_pairs for verdict in verdicts(flights / f"{FIRST}.mcap", wet)]
    assert [len(scan) for scan in given] == in_flight


def rotated(source: Path, directory: Path) -> list[Path]:
    """The same records as a session of two files."""
    recording = Recording(source)
    records = list(recording)
    middle = len(records) // 2
    files = [file_of_session(directory / source.name, number) for number in (1, 2)]
    for path, some in zip(files, (records[:middle], records[middle:]), strict=True):
        recorder = Recorder(path, recording.metadata)
        recorder.append(some)
        recorder.close()
    return files


def test_a_rotated_session_counts_once_however_often_its_files_are_named(flights: Path, tmp_path: Path) -> None:
    """And what comes of it is what comes of the recordings in one piece; a monitor that loads it says its name."""
    (tmp_path / "there").mkdir()
    first, second = rotated(flights / f"{FIRST}.mcap", tmp_path), flights / f"{SECOND}.mcap"
    round_about = tmp_path / "there" / ".." / first[0].name
    output = tmp_path / "radar.json"
    named = [tmp_path, *first, round_about, second, "-o", output, "--least-scans", 2 * SWEEPS]
    run = CliRunner().invoke(app, ["calibrate", "radar", *map(str, named)])
    assert run.exit_code == 0, run.exception
    made = load_calibration(output)
    assert f"of {2 * SWEEPS} that were compared" in made.provenance
    whole = reads(flights, None)
    expected = calibration("radar", whole, material(whole), 2 * SWEEPS)
    assert made == expected.model_copy(update={"provenance": made.provenance})

    low = {"radio_altitude_limit_m": 1.0}  # above which nothing is compared
    for monitor, verdict in (({}, "ok"), (low, "unavailable")):
        told = list(verdicts(second, rack(calibration=output, monitor=monitor)))
        assert [one.calibration for one in told] == ["radar"] * SWEEPS
        assert verdict in {one.verdict for one in told}
