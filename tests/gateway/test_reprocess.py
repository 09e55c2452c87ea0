"""Many recordings worked out again: what comes of them, where it lands, what is done anew, and a worker that dies."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gateway.config import load_config
from gateway.errors import GatewayError
from gateway.events import IntegrityEvent
from gateway.metadata import recorded_config, recorded_monitor
from gateway.recording import Recording
from gateway.replay import replay
from gateway.reprocess import work as work_module
from gateway.reprocess.dataset import DataSet
from gateway.reprocess.job import Job, Outcome, jobs
from gateway.reprocess.run import reprocess
from gateway.reprocess.work import key, work
from tests.gateway.changing import Changing
from tests.gateway.flown import record_flight
from tests.gateway.live import wait_until
from tests.gateway.shell import GATEWAY, shadebus

COUNT = 4


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("flights")
    (directory / "second").mkdir()
    for seed in range(COUNT):
        record_flight(directory / ("second" if seed % 2 else "") / f"flight{seed}.mcap", seed)
    return directory


def said_by_replay(path: Path) -> list[tuple[object, ...]]:
    recording = Recording(path)
    config = recorded_config(recording.metadata)
    found: list[tuple[object, ...]] = []

    def take(event: object) -> None:
        if isinstance(event, IntegrityEvent):
            found.append((event.time_ns, event.scan, event.verdict, event.q, event.reasons))

    replay(recording, config, recorded_monitor(recording.metadata, config), take, list[str]().append)
    return found


def test_the_verdicts_of_a_recording_are_those_of_its_replay(flights: Path) -> None:
    for job in jobs(flights, None, ()):
        rows = work(job).verdicts
        found = [(row["utc_ns"], row["scan"], row["verdict"], row["q"], tuple(row["reasons"])) for row in rows]
        assert found == said_by_replay(job.path)
        assert len(found) == 2


def test_results_land_in_one_data_set_that_others_can_query(flights: Path, tmp_path: Path) -> None:
    run = shadebus("reprocess", flights, "-o", tmp_path / "out")
    assert (run.returncode, run.stderr) == (0, "")
    assert f"{COUNT} worked out, 0 held already" in run.stdout
    found = duckdb.sql(
        f"select recording, count(*) from '{tmp_path}/out/verdicts/**/*.parquet' group by recording order by recording"
    )
    assert found is not None
    assert found.fetchall() == [("flight0", 2), ("flight2", 2), ("second/flight1", 2), ("second/flight3", 2)]
    again = shadebus("reprocess", flights, "-o", tmp_path / "out")
    assert f"0 worked out, {COUNT} held already" in again.stdout


def test_recordings_are_in_the_table_and_the_data_set_whatever_their_names_begin_with(
    flights: Path, tmp_path: Path
) -> None:
    names = [".hidden/a", ".b", "_old/c", "_d", "e.parquet/f.part"]
    for name in names:
        path = tmp_path / "in" / f"{name}.mcap"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(flights / "flight0.mcap")
    run = shadebus("reprocess", tmp_path / "in", "-o", tmp_path / "out")
    assert (run.returncode, run.stderr) == (0, "")
    cells = [[cell.strip() for cell in line.split("|")] for line in run.stdout.splitlines()]
    assert {row[1]: sum(map(int, row[3:6])) for row in cells if row[1:] and row[1] in names} == dict.fromkeys(names, 2)
    found = duckdb.sql(f"select recording, count(*) from '{tmp_path}/out/verdicts/**/*.parquet' group by recording")
    assert found is not None
    assert dict(found.fetchall()) == dict.fromkeys(names, 2)


@pytest.fixture(scope="module")
def outcome(flights: Path) -> Outcome:
    return work(Job("flight", (flights / "flight0.mcap",)))


def holds(data: DataSet, outcome: Outcome) -> bool:
    return data.has("flight", lambda: outcome.whole["key"])


def columns_of(path: Path) -> "list[pq.ColumnChunkMetaData]":
    group = pq.read_metadata(path).row_group(0)
    return [group.column(index) for index in range(group.num_columns)]


@pytest.mark.parametrize("table", ["recordings", "verdicts"])
@pytest.mark.parametrize("damage", ["gone", "empty", "zeros", "cut", "another table", "a bit"])
def test_a_result_that_cannot_be_read_counts_as_none_and_is_named_until_it_is_made_anew(
    outcome: Outcome, tmp_path: Path, table: str, damage: str
) -> None:
    data, path = DataSet(tmp_path), tmp_path / table / "flight.parquet"
    data.put("flight", outcome)
    assert holds(data, outcome)
    whole = path.read_bytes()
    column = next(column for column in columns_of(path) if column.path_in_schema in ("key", "verdict"))
    at = column.data_page_offset + column.total_compressed_size - 1
    flipped = whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :]
    damaged = {"empty": b"", "zeros": bytes(len(whole)), "cut": whole[:-1], "a bit": flipped}
    if damage == "gone":
        path.unlink()
    elif damage == "another table":
        pq.write_table(pa.table({"recording": ["flight"]}), path)
    else:
        path.write_bytes(damaged[damage])
    assert not holds(data, outcome)
    assert data.summary() == ([], ["flight"])

    data.put("flight", outcome)
    assert holds(data, outcome)
    ((row,), damaged_now) = data.summary()
    assert (row["recording"], damaged_now) == ("flight", [])


def test_what_was_left_half_written_is_no_result_and_in_nobodys_way(outcome: Outcome, tmp_path: Path) -> None:
    for table in ("recordings", "verdicts"):
        (tmp_path / table).mkdir()
        (tmp_path / table / "flight.part").write_bytes(b"half" * 25)
    data = DataSet(tmp_path)
    assert (data.names(), data.summary()) == ([], ([], []))
    data.put("flight", outcome)
    assert holds(data, outcome)


def test_a_result_is_on_the_disk_before_its_name_is(
    outcome: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[tuple[str, int]] = []

    def note(fd: int) -> None:
        path = Path(f"/proc/self/fd/{fd}").readlink()
        assert not path.with_suffix(".parquet").exists()
        synced.append((path.parent.name, path.stat().st_size))

    monkeypatch.setattr(os, "fsync", note)
    DataSet(tmp_path).put("flight", outcome)
    assert synced == [
        (table, (tmp_path / table / "flight.parquet").stat().st_size) for table in ("verdicts", "recordings")
    ]


def test_a_damaged_result_of_a_recording_that_is_gone_is_named_with_the_mend(
    flights: Path, outcome: Outcome, tmp_path: Path
) -> None:
    data = DataSet(tmp_path)
    for name in ("gone", "flight0"):
        data.put(name, outcome)
        (tmp_path / "recordings" / f"{name}.parquet").write_bytes(b"")
    run = shadebus("reprocess", flights / "flight0.mcap", "-o", tmp_path)
    assert run.returncode == 1
    assert "1 worked out, 0 held already" in run.stdout
    assert run.stderr == f"shadebus: gone: its result cannot be read; delete {tmp_path}/*/gone.parquet\n"


def test_an_output_that_is_a_file_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for output in (tmp_path / "file", tmp_path / "file/below"):
        with pytest.raises(GatewayError, match=f"cannot write {output}: Not a directory; choose another place with -o"):
            DataSet(output)


def test_another_program_on_the_port_of_a_dask_dashboard_is_no_concern(flights: Path, tmp_path: Path) -> None:
    with socket.socket() as other:
        with suppress(OSError):  # then it is taken already
            other.bind(("127.0.0.1", 8787))
        run = shadebus("reprocess", flights / "flight0.mcap", "-o", tmp_path)
    assert (run.returncode, run.stderr) == (0, "")


def test_ctrl_c_ends_all_processes_without_a_word_and_another_run_does_the_rest(flights: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = [*GATEWAY, "reprocess", str(flights), "-o", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as process:
        wait_until(lambda: any(out.rglob("recordings/**/*.parquet")) or process.poll() is not None, "a result")
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate()  # until the last process that has them open has ended
    assert (process.returncode, errors) == (-signal.SIGINT, b"")
    again = shadebus("reprocess", flights, "-o", out)
    assert (again.returncode, again.stderr) == (0, "")
    made, held = (int(part.split()[0]) for part in again.stdout.splitlines()[-1].split(", "))
    assert made + held == COUNT
    assert held


def test_only_what_is_new_or_has_changed_is_done_again(
    flights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed, data = jobs(flights, None, ())[:2], DataSet(tmp_path)
    data.put(listed[0].name, work(listed[0]))
    assert data.has(listed[0].name, partial(key, listed[0]))
    assert not data.has(listed[1].name, partial(key, listed[1]))
    config = recorded_config(Recording(listed[0].path).metadata)
    other = config.model_copy(update={"monitor": config.monitor.model_copy(update={"p_fa": 1e-3})})
    changed = [
        listed[0]._replace(config=json.dumps(other.model_dump(mode="json"))),
        listed[0]._replace(terrain=(Path(__file__).parents[1] / "data/terrain/sierra_nevada_1arcsec_wgs84.tif",)),
    ]
    for job in changed:
        assert not data.has(job.name, partial(key, job))
    before = key(listed[0])
    os.utime(listed[0].path, ns=(1, 1))
    assert key(listed[0]) != before
    monkeypatch.setattr(work_module, "code_version", lambda: "other code")
    data.put(listed[1].name, work(listed[1]))
    monkeypatch.undo()
    assert not data.has(listed[1].name, partial(key, listed[1]))


def test_a_worker_that_lives_on_takes_terrain_and_calibration_as_they_are_now(flights: Path, tmp_path: Path) -> None:
    """And as they were again: what it keeps of a file is for that file."""
    changing = Changing(flights / "flight0.mcap", tmp_path)
    changing.raise_terrain(0)
    changing.calibrate("first")
    first = changing.outcome()
    assert first[:2] == ({"first"}, False)
    assert changing.outcome() == first

    changing.calibrate("another")
    calibrated = changing.outcome()
    assert calibrated[:2] == ({"another"}, False)

    changing.raise_terrain(1000)
    raised = changing.outcome()
    assert raised[:2] == ({"another"}, True)
    assert len({first[2], calibrated[2], raised[2]}) == 3

    changing.raise_terrain(0)
    changing.calibrate("first")
    assert changing.outcome() == first


def test_a_file_of_another_size_is_another_one_whatever_its_time_of_change(flights: Path, tmp_path: Path) -> None:
    """As where a copy keeps the time of its source."""
    changing = Changing(flights / "flight0.mcap", tmp_path)
    changing.raise_terrain(0)
    found = []
    for name in ("short", "much longer"):
        changing.calibrate(name)
        os.utime(tmp_path / "radar.json", ns=(1, 1))
        found.append(changing.outcome())
    assert [calibrations for calibrations, _, _ in found] == [{"short"}, {"much longer"}]
    assert found[0][2] != found[1][2]


def test_recordings_of_terrain_that_changes_meanwhile_are_refused_from_then_on(tmp_path: Path) -> None:
    changing = Changing(tmp_path / "own.mcap", tmp_path)
    changing.raise_terrain(0)
    record_flight(changing.path, 5, 1, terrain=[tmp_path / "N44W072.hgt"])
    as_recorded = Job("own", (changing.path,))
    assert len(work(as_recorded).verdicts) == 1
    changing.raise_terrain(1)
    for ask in (work, key):
        with pytest.raises(GatewayError, match=r"N44W072\.hgt changed since the recording was made"):
            ask(as_recorded)


def test_one_recording_that_cannot_be_worked_out_costs_no_other(flights: Path, tmp_path: Path) -> None:
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    (mixed / "good.mcap").symlink_to(flights / "flight0.mcap")
    (mixed / "none.mcap").write_bytes(b"no recording at all")
    run = shadebus("reprocess", mixed, "-o", tmp_path / "out")
    assert run.returncode == 1
    assert "1 worked out" in run.stdout
    assert "none: " in run.stderr
    assert "is not a shadebus recording" in run.stderr


@pytest.mark.parametrize(
    ("name", "source", "said"),
    [
        ("other", "serial:x", "was recorded from bridge, and the rack file names none of them"),
        (
            "bridge",
            "udp:127.0.0.1:1",
            "read in another way than those of udp:127.0.0.1:1: give bridge the kind of line",
        ),
    ],
)
def test_a_rack_file_that_does_not_fit_the_recording_is_refused(
    flights: Path, tmp_path: Path, name: str, source: str, said: str
) -> None:
    (tmp_path / "rack.toml").write_text(f'[[adapters]]\nname = "{name}"\nsource = "{source}"\n')
    (job,) = jobs(flights / "flight0.mcap", load_config(tmp_path / "rack.toml"), ())
    with pytest.raises(GatewayError, match=said):
        work(job)


def test_a_directory_without_recordings_is_named(tmp_path: Path) -> None:
    with pytest.raises(GatewayError, match=f"{tmp_path} holds no recordings"):
        jobs(tmp_path, None, ())


def test_an_address_at_which_no_scheduler_answers_is_refused_with_the_mend(flights: Path, tmp_path: Path) -> None:
    addresses = "nonsense", "tls://127.0.0.1:9", "tcp://127.0.0.1:9"

    def refused(address: str) -> "subprocess.CompletedProcess[str]":
        # In a process of its own: a client that failed leaves Dask's threads in it.
        return shadebus("reprocess", flights, "-o", tmp_path, "--scheduler", address)

    with ThreadPoolExecutor() as at_once:  # they wait for an answer
        found = at_once.map(refused, addresses)
    for address, done in zip(addresses, found, strict=True):
        assert done.returncode == 1
        (line,) = done.stderr.splitlines()
        assert f"no Dask scheduler answers at {address}: " in line
        assert "; start dask scheduler and give the address" in line


class Cluster:
    """A scheduler and two workers, each a process of its own, on loopback."""

    def __init__(self, directory: Path) -> None:
        self.file = directory / "scheduler.json"
        self.processes = [self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")]
        while not self.file.exists() or not self.file.stat().st_size:  # it is there before what it says
            time.sleep(0.05)
        self.address: str = json.loads(self.file.read_text())["address"]
        worker = ("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
        self.processes += [self._start(*worker), self._start(*worker)]

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments, "--scheduler-file", str(self.file)]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    for process in made.processes:
        process.kill()
        process.wait()


def test_on_a_cluster_whose_worker_is_killed_half_way_the_result_is_the_same(
    flights: Path, tmp_path: Path, cluster: Cluster
) -> None:
    listed, data = jobs(flights, None, ()), DataSet(tmp_path / "out")

    def kill_one(done: int, of: int) -> None:
        if done == of // 2 and cluster.processes[1].poll() is None:
            cluster.processes[1].send_signal(signal.SIGKILL)
            cluster.processes[1].wait()

    done = reprocess(listed, data, cluster.address, kill_one)
    assert cluster.processes[1].returncode == -signal.SIGKILL
    assert (done.failed, len(done.made)) == ({}, COUNT)
    for job in listed:
        DataSet(tmp_path / "own").put(job.name, work(job))
        there, own = (tmp_path / place / "verdicts" / f"{job.name}.parquet" for place in ("out", "own"))
        assert pq.read_table(there).equals(pq.read_table(own))
