"""Water beside the terrain in a rack file: a recording keeps which it was, and is not judged with another."""

import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gateway.cli import app
from gateway.config import RackConfig, check_config
from gateway.errors import GatewayError
from gateway.metadata import build_monitor, describe, recorded_config, recorded_monitor
from gateway.recording import Recorder, Recording
from gateway.recording.merging import merge
from gateway.records import Stamp, Status
from gateway.reprocess.job import Job, jobs
from gateway.reprocess.work import key, work
from simulators.scenario import BUILT_IN_TERRAIN
from tests.gateway.flown import record_flight
from tests.gateway.shell import shadebus, within

TERRAIN = BUILT_IN_TERRAIN["white_mountains"]


def lake(path: Path, north: float = 44.6) -> Path:
    west, south, east, north = -71.6004, 44.5004, -71.5004, north + 0.0004  # between posts
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


def rack(water: list[Path], terrain: Path | None = TERRAIN) -> RackConfig:
    table: dict[str, object] = {"adapters": [{"name": "bridge", "source": "serial:x"}], "water": water}
    return check_config({**table, "terrain": [terrain] if terrain else []}, "test")


def record(path: Path, config: RackConfig) -> Path:
    recorder = Recorder(path, describe(config, build_monitor(config)))
    recorder.append([Status(0, Stamp(0, 0), "bridge", "UP")])
    recorder.close()
    return path


def test_a_recording_keeps_its_water_and_is_judged_with_it(tmp_path: Path) -> None:
    config = rack([lake(tmp_path / "lake.geojson")])
    recording = Recording(record(tmp_path / "r.mcap", config))
    kept = recorded_config(recording.metadata)
    assert kept.water == config.water
    live, again = build_monitor(config), recorded_monitor(recording.metadata, kept)
    assert live and live.water and again and again.water
    assert live.water.checksum == again.water.checksum == recording.metadata["water_checksum"] != ""
    wet = again.water.on(again.terrain).wet.sum(), live.water.on(live.terrain).wet.sum()
    assert wet == (120 * 120, 120 * 120), "0.1 degrees of posts 3 seconds apart"
    shown = within("info", recording.path).stdout
    assert recording.metadata["water_checksum"] in shown
    assert "lake.geojson" in "".join(shown.split())


def test_water_that_has_changed_since_is_refused_by_name_with_other_terrain_too(tmp_path: Path) -> None:
    recording = Recording(record(tmp_path / "r.mcap", rack([lake(tmp_path / "lake.geojson")])))
    lake(tmp_path / "lake.geojson", north=44.7)
    for terrain in ((), (TERRAIN,)):
        with pytest.raises(GatewayError, match=r"lake\.geojson changed since the .*: name the water .* with --water"):
            recorded_monitor(recording.metadata, recorded_config(recording.metadata), terrain)
    (tmp_path / "lake.geojson").unlink()
    with pytest.raises(GatewayError, match=r"lake\.geojson cannot be read"):
        recorded_monitor(recording.metadata, recorded_config(recording.metadata))


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep with water that was recorded, and then drawn anew."""
    directory = tmp_path_factory.mktemp("flown")
    record_flight(directory / "flight.mcap", 1, 1, water=[lake(directory / "lake.geojson")])
    lake(directory / "lake.geojson", north=44.7)
    return directory / "flight.mcap"


@pytest.fixture
def sea(tmp_path: Path) -> Path:
    """All that the aircraft sees."""
    ring = [[-73, 43], [-70, 43], [-70, 46], [-73, 46], [-73, 43]]
    path = tmp_path / "sea.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


def test_a_replay_takes_other_water_by_name(flight: Path, sea: Path) -> None:
    refused = within("replay", flight)
    assert (refused.returncode, "name the water to use with --water" in refused.stderr) == (1, True)
    replayed = shadebus("replay", flight, "--json", "--water", sea)
    assert replayed.returncode == 0, replayed.stderr
    (told,) = (event for event in map(json.loads, replayed.stdout.splitlines()) if event["type"] == "integrity")
    assert told["n_pairs"] == 0
    assert any("do not count: over water" in reason for reason in told["reasons"])


@pytest.mark.parametrize("config", [None, rack([])], ids=["as recorded", "by a rack file"])
def test_recordings_are_worked_out_again_with_other_water(flight: Path, sea: Path, config: RackConfig | None) -> None:
    (job,) = jobs(flight, config, (), [sea])
    outcome = work(job)
    assert [row["n_pairs"] for row in outcome.verdicts] == [0]
    assert outcome.whole["key"] == key(job)
    lake(sea)
    assert work(job).verdicts[0]["n_pairs"] > 20
    assert key(job) != outcome.whole["key"]


def test_reprocess_and_run_hand_on_the_water_that_they_are_given(
    flight: Path, tmp_path: Path, signals_left_alone: None
) -> None:
    missing = tmp_path / "no.geojson"
    for verb in (
        ("reprocess", flight.parent, "-o", tmp_path / "out"),
        ("calibrate", "radar", flight, "-o", tmp_path / "radar.json"),
        ("run", "--source", "serial:/dev/null", "--dem", TERRAIN),
    ):
        done = CliRunner().invoke(app, [*map(str, verb), "--water", str(missing)])
        assert "no.geojson cannot be read" in str(done.exception)


def test_a_recording_of_before_there_was_water_is_read_as_one_without(tmp_path: Path) -> None:
    metadata = dict(Recording(record(tmp_path / "r.mcap", rack([]))).metadata)
    assert metadata.pop("water_checksum") == ""
    monitor = recorded_monitor(metadata, recorded_config(metadata))
    assert monitor and monitor.water is None


def test_water_without_terrain_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GatewayError, match="water without terrain"):
        build_monitor(rack([lake(tmp_path / "lake.geojson")], terrain=None))


def test_water_away_from_the_terrain_is_refused_before_anything_opens(tmp_path: Path) -> None:
    far = tmp_path / "far.geojson"
    ring = [[10, 50], [11, 50], [11, 51], [10, 50]]
    far.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    with pytest.raises(GatewayError, match=r"far\.geojson lies outside the terrain"):
        build_monitor(rack([far]))


def test_other_water_is_another_outcome_to_work_out(tmp_path: Path) -> None:
    recording = record(tmp_path / "r.mcap", rack([lake(tmp_path / "lake.geojson")]))
    again = Job("r", (recording,), json.dumps(rack([tmp_path / "lake.geojson"]).model_dump(mode="json")))
    before = key(again)
    assert key(again) == before
    lake(tmp_path / "lake.geojson", north=44.7)
    os.utime(tmp_path / "lake.geojson", ns=(1, 1))
    assert key(again) != before


def test_recordings_with_different_water_are_not_merged(tmp_path: Path) -> None:
    for name, north in (("a", 44.6), ("b", 44.7)):
        record(tmp_path / f"{name}.mcap", rack([lake(tmp_path / f"{name}.geojson", north)]))
    record(tmp_path / "none.mcap", rack([]))
    one, other, without = (Recording(tmp_path / f"{name}.mcap") for name in ("a", "b", "none"))
    with pytest.raises(GatewayError, match=r"a\.mcap and b\.mcap were recorded with a different water"):
        merge([one, other], tmp_path / "out.mcap")
    merge([without, one], tmp_path / "out.mcap")
    merged = Recording(tmp_path / "out.mcap").metadata
    assert merged["water_checksum"] == one.metadata["water_checksum"]
    assert recorded_config(merged).water == (tmp_path / "a.geojson",)
