"""Calibration from real recordings and by Monte Carlo: what the verbs print, write and refuse."""

import hashlib
import json
import math
import os
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine
from typer.testing import CliRunner, Result

from gateway.calibrate.dem import as_published, figures, monte_carlo, setup_of
from gateway.calibrate.radar import calibration, material
from gateway.calibrate.recorded import CELLS, Compared, Read, Setting, read
from gateway.calibrate.workers import on_all_cores
from gateway.cli import app
from gateway.errors import GatewayError
from gateway.events import IntegrityEvent
from gateway.mdb_plot import Configuration, plot_mdb
from gateway.metadata import recorded_config, recorded_monitor
from gateway.recording import Recording
from gateway.replay import replay
from gateway.reprocess.job import jobs
from monitor.calibration import load_calibration
from monitor.integrity import Monitor
from monitor.monte_carlo import Variables, around, simulate
from monitor.sample import ScanSample, Unmatched
from monitor.settings import MonitorSettings
from monitor.terrain import open_terrain
from monitor.warmup import warm_up
from simulators.scenario import BUILT_IN_TERRAIN
from tests.gateway.flown import record_flight
from tests.gateway.shell import shadebus
from tests.gateway.test_cli_words import rows

MOUNTAINS = BUILT_IN_TERRAIN["white_mountains"]
SIERRA = Path(__file__).parents[1] / "data/terrain/sierra_nevada_1arcsec_wgs84.tif"
SWEEPS = 3


def invoke(*arguments: str | Path) -> Result:
    """A verb within this process, which saves its start."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module", autouse=True)
def _compiled_too() -> None:
    """What the verbs compile at their first start ever, they must not compile within a test's time."""
    terrain = open_terrain(MOUNTAINS)
    warm_up(Monitor(terrain))
    setup = setup_of(Variables(44.5, -71.5, 900.0), MonitorSettings(), 512, 10.0, 3.0, seed=1)
    simulate(around(terrain.grid, setup), setup, range(1))


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("flights")
    for seed in (1, 2):
        record_flight(directory / f"flight{seed}.mcap", seed, SWEEPS)
    return directory


def test_recorded_flights_become_a_file_that_the_monitor_loads(flights: Path, tmp_path: Path) -> None:
    made, page = tmp_path / "radar.json", tmp_path / "page"
    one = flights / "flight2.mcap"  # which the directory holds too, and which counts once
    run = shadebus("calibrate", "radar", flights, one, "-o", made, "--least-scans", "6", "--report", page)
    assert run.returncode == 0, run.stderr
    found = load_calibration(made)
    assert (found.name, found.bins, found.range_nm) == ("radar", 512, 10.0)
    assert [(rate.p_fa, rate.scans) for rate in found.checked] == [(p, 3) for p in (0.1, 0.01, 0.001, 0.0001)]
    assert found.provenance.startswith("3 scans fitted and 3 checked, of 6 that were compared")
    for path in sorted(flights.glob("*.mcap")):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        assert f"{path.stem} (1970-01-01 00:00:00 UTC, SHA-256 {digest[:16]}" in found.provenance
    assert f"(checksum {open_terrain(MOUNTAINS).checksum})" in found.provenance
    table = rows(run.stdout)
    head, *cells = table
    assert head[:3] == ["range limit (NM)", "shadow size (bins)", "residuals"]
    named = [(cell[0], cell[1]) for cell in cells]
    assert named == [(limit, f"1-{size}") for limit in ("10", "5", "2.5") for size in (64, 32, 16, 8)]
    counts = np.array([int(cell[2]) for cell in cells]).reshape(3, 4)
    assert counts.min() > 0
    assert (np.diff(counts, axis=0) < 0).all()
    assert (np.diff(counts, axis=1) < 0).all()
    assert (page / "residuals.png").read_bytes().startswith(b"\x89PNG")
    assert all(f"<td>{cell[2]}<td>{cell[3]}" in (page / "index.html").read_text() for cell in cells)


def test_where_the_terrain_lies_is_told_and_a_calibration_over_wrong_terrain_owns_up_to_it(
    flights: Path, tmp_path: Path
) -> None:
    with rasterio.open(MOUNTAINS) as source:
        height_m, profile, to = source.read(), source.profile, source.transform
    west = 300 / (111_320 * math.cos(math.radians(44.5)))  # of degrees a metre
    east_by = Affine.translation(round(west / to.a) * to.a, 0) @ to
    with rasterio.open(tmp_path / "east.tif", "w", **{**profile, "driver": "GTiff", "transform": east_by}) as moved:
        moved.write(height_m)
    asked = ("calibrate", "radar", flights, "-o", tmp_path / "out.json", "--least-scans", "4")
    right, wrong = invoke(*asked), invoke(*asked, "--dem", tmp_path / "east.tif")
    told = re.compile(r"lies \d+ m \w+ and (\d+) m (\w+) of where .* \(standard errors \d+ and \d+ m\)(.*)")
    (rightly_m, silent), (off_m, advice) = (
        (int(metres) if side == "east" else -int(metres), said)
        for run in (right, wrong)
        for metres, side, said in told.findall(run.output)
    )
    assert abs(rightly_m) < 40
    assert not silent
    assert off_m == pytest.approx(300, abs=100)
    assert advice.startswith(": check its datum")


def test_what_is_fitted_is_what_the_verdicts_of_a_replay_rest_on(flights: Path) -> None:
    (job, _) = jobs(flights, None, ())
    recording = Recording(job.path)
    config = recorded_config(recording.metadata)
    verdicts: list[tuple[int, float | None]] = []

    def take(event: object) -> None:
        if isinstance(event, IntegrityEvent):
            verdicts.append((event.n_pairs, event.mean_bins))

    replay(recording, config, recorded_monitor(recording.metadata, config), take, list[str]().append)
    found = [(len(scan.sample.disparities), float(np.mean(scan.sample.disparities))) for scan in read(job).scans]
    assert found == verdicts
    assert len(found) == SWEEPS


def test_a_recording_is_read_anew_with_another_rack_file(flights: Path, tmp_path: Path) -> None:
    rack = tmp_path / "rack.toml"
    rack.write_text(
        f'terrain = ["{MOUNTAINS}"]\ncalibration = "not-made-yet.json"\n'
        '[[adapters]]\nname = "bridge"\nsource = "serial:x"\n[monitor]\np_fa = 0.05\n'
    )
    run = invoke("calibrate", "radar", flights, "-c", rack, "-o", tmp_path / "out.json", "--least-scans", "4")
    assert run.exit_code == 0, run.output
    found = load_calibration(tmp_path / "out.json")
    assert [rate.p_fa for rate in found.checked] == [0.1, 0.05, 0.01, 0.001]
    assert 'monitor settings {"p_fa": 0.05}' in found.provenance


def test_too_few_scans_are_refused_with_what_to_fly(flights: Path, tmp_path: Path) -> None:
    few = invoke("calibrate", "radar", flights, "-o", tmp_path / "out.json")
    assert "6 of 6 scans have the 20 pairs" in str(few.exception)
    assert "1000 are wanted: fly a few hundred metres above the ground" in str(few.exception)
    assert len(rows(few.stdout)) == 1 + len(CELLS)  # the table is printed all the same
    elsewhere = invoke("calibrate", "radar", flights, "--dem", SIERRA, "-o", tmp_path / "out.json")
    assert "0 of 6 scans have the 20 pairs" in str(elsewhere.exception)
    assert not (tmp_path / "out.json").exists()


def test_recordings_without_terrain_and_files_that_are_none_are_named(tmp_path: Path) -> None:
    record_flight(tmp_path / "bare.mcap", 3, 1, terrain=[])
    bare = invoke("calibrate", "radar", tmp_path, "-o", tmp_path / "out.json")
    assert "bare.mcap was recorded without terrain: name" in str(bare.exception)
    (tmp_path / "none.mcap").write_bytes(b"no recording")
    none = invoke("calibrate", "radar", tmp_path / "none.mcap", "-o", tmp_path / "out.json")
    assert "none.mcap is not a shadebus recording" in str(none.exception)


def made(name: str, begins_utc_ns: int, *scans: Compared, p_fa: float = 1e-4, refusals: int = 0) -> Read:
    said = Counter({"radar is in mode 1, not map": refusals} if refusals else {})
    return Read(
        name,
        hashlib.sha256(name.encode()).hexdigest(),
        "hills",
        MonitorSettings(p_fa=p_fa),
        begins_utc_ns,
        "",
        list(scans),
        said,
    )


def scan(value: float, range_nm: float = 10.0) -> Compared:
    """Twenty disparities about a value, which tells one scan from another."""
    d = value + np.tile([-2.0, -1.0, 1.0, 2.0], 5)
    sample = ScanSample(d, d, np.zeros(len(d)), np.ones(len(d)), Unmatched(2, 10), Unmatched(2, 10), 3.0)
    return Compared(Setting(512, range_nm, "arinc708"), sample, (d,) * len(CELLS))


def test_two_copies_of_a_recording_are_refused() -> None:
    one = made("one", 10, scan(1))
    copy = replace(one, name="copy")
    with pytest.raises(GatewayError, match="one and copy are the same recording: name one of them"):
        material([one, made("two", 20, scan(2)), copy])


def test_the_commonest_radar_setting_is_calibrated_in_order_of_time_and_the_rest_counted() -> None:
    found = material([made("late", 20, scan(3), scan(4)), made("early", 10, scan(1, 20.0), scan(2))])
    assert (found.setting, found.left_out) == (Setting(512, 10.0, "arinc708"), 1)
    assert [float(np.mean(s.sample.disparities)) for s in found.scans] == [2.0, 3.0, 4.0]


def test_the_first_half_is_fitted_and_the_second_checks_it() -> None:
    """The fit has the median of the first half, 0; disparities about 50 in the second alert in every scan."""
    reads = [made("first", 1, *[scan(0)] * 4), made("second", 2, *[scan(50)] * 4)]
    found = calibration("name", reads, material(reads), 8)
    assert found.median_bins == 0.0
    assert {(rate.scans, rate.alerts) for rate in found.checked} == {(4, 4)}


def test_scans_that_could_not_be_compared_are_told_with_their_reason() -> None:
    with pytest.raises(GatewayError, match=r"5 scans: radar is in mode 1, not map\): fly a few hundred metres"):
        material([made("weather", 1, refusals=5)])
    with pytest.raises(GatewayError, match=r"no scan at all"):
        material([made("silent", 1)])


def test_recordings_with_different_monitor_settings_are_refused() -> None:
    reads = [made("one", 1, scan(0)), made("two", 2, scan(0), p_fa=1e-3)]
    with pytest.raises(GatewayError, match="two and one have different monitor settings: give one rack file by -c"):
        calibration("name", reads, material(reads), 2)


def test_a_worker_that_is_killed_ends_the_work_with_a_sentence() -> None:
    with pytest.raises(GatewayError, match="was killed in its work: is the memory full"):
        list(on_all_cores(os._exit, [9]))


PAPER_RUN = ("calibrate", "dem", "--dem", MOUNTAINS, "--paper", "--runs", "30", "--heights-m", "765,1165")


def test_the_monte_carlo_prints_a_row_for_each_height_and_is_the_same_again(tmp_path: Path) -> None:
    first = shadebus(*PAPER_RUN, "-o", tmp_path / "first.json", "--report", tmp_path / "page")
    assert first.returncode == 0, first.stderr
    said = json.loads((tmp_path / "first.json").read_text())
    _, *table = rows(first.stdout)
    assert [(row[0], int(row[3])) for row in table] == [(f"{h['height_m']:.0f}", h["pairs"]) for h in said["heights"]]
    assert [row[0] for row in table] == ["765", "1165"]
    assert (tmp_path / "page" / "residuals.png").read_bytes().startswith(b"\x89PNG")
    assert invoke(*PAPER_RUN, "-o", tmp_path / "again.json").exit_code == 0
    assert json.loads((tmp_path / "again.json").read_text())["heights"] == said["heights"]
    terrain = open_terrain(MOUNTAINS)
    setup = as_published(setup_of(Variables(44.5, -71.5, 1165.0), MonitorSettings(), 512, 10.0, 3.0, seed=1))
    alone = simulate(around(terrain.grid, setup), setup, range(30)).residuals
    assert said["heights"][1]["pairs"] == len(alone.front)
    assert said["heights"][1]["sigma_back_bins"] == pytest.approx(float(np.std(alone.back, ddof=1)), rel=1e-12)


def test_fewer_shadows_are_seen_from_higher_up_and_their_sizes_keep_to_the_paper() -> None:
    """Table 5: the number falls with height, once above the ridges; sizes of 3 to 126 bins of 128 to the limit."""
    setup = as_published(setup_of(Variables(44.5, -71.5), MonitorSettings(), 512, 10.0, 3.0, seed=1))
    found = [figures(row) for row in monte_carlo(open_terrain(MOUNTAINS).grid, setup, (765.0, 965.0, 1165.0), 2)]
    counts = [row["pairs"] for row in found]
    assert counts == sorted(counts, reverse=True)
    assert (setup.bins, setup.sizes, setup.bin_width_m, setup.beam.azimuth_fan) == (128, (3, 126), 144.8, 1)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--at", "44.5"), "--at takes LAT,LON"),
        (("--at", "nan,-71.5"), "--at takes LAT,LON"),
        (("--at", "50,-71.5"), "the terrain has no height at 50.000000, -71.500000: name a place in it by --at"),
        (("--heights-m", "low"), "--heights-m takes metres"),
        (("--heights-m", "900,100"), "100 m is not above the ground, which lies at 315 m there"),
        (("--range-nm", "300", "--runs", "1", "--heights-m", "900"), "every radial of 300 NM leaves the terrain"),
        (("--paper", "--bins", "256"), "leave --bins and --range-nm out"),
    ],
)
def test_what_cannot_be_simulated_is_refused(arguments: tuple[str, ...], complaint: str, tmp_path: Path) -> None:
    run = invoke("calibrate", "dem", "--dem", MOUNTAINS, "-o", tmp_path / "out.json", *arguments)
    assert isinstance(run.exception, GatewayError)
    assert complaint in str(run.exception)
    assert not (tmp_path / "out.json").exists()


def test_terrain_must_be_named(tmp_path: Path) -> None:
    assert "no terrain file given" in str(invoke("calibrate", "dem", "-o", tmp_path / "out.json").exception)


def test_the_picture_of_thresholds_has_a_dot_for_each_row_of_table_2(tmp_path: Path) -> None:
    sets = ((1e-1, 1e-5), (1e-3, 1e-3), (1e-5, 1e-1))
    table_2 = [Configuration(n, sigma, *both) for n, sigma in ((60, 2.0), (120, 4.0)) for both in sets]
    (axes,) = plot_mdb(tmp_path / "mdb", table_2).axes
    dots = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    found = [(n, round(bins, 2)) for dot in dots for n, bins in np.asarray(dot).tolist()]
    assert found == [(60, 3.53), (60, 3.70), (60, 3.38), (120, 5.64), (120, 5.92), (120, 5.43)]
    curves = [np.asarray(line.get_ydata()) for line in axes.lines if line.get_marker() != "o"]
    assert len(curves) == 6
    assert all((np.diff(curve) < 0).all() for curve in curves)


def test_thresholds_writes_its_picture(tmp_path: Path) -> None:
    assert invoke("thresholds", "--plot", tmp_path / "mdb.png").exit_code == 0
    assert (tmp_path / "mdb.png").read_bytes().startswith(b"\x89PNG")
