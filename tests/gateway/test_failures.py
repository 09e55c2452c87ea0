"""Nothing in the gateway can die silently: whatever breaks is in `failures`, and what can go on goes on."""

import errno
import json
import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from gateway import service as service_module
from gateway.adapters import Port
from gateway.config import RackConfig
from gateway.errors import GatewayError
from gateway.events import Event
from gateway.metadata import build_monitor
from gateway.recording import Recorder, Recording, keeper
from gateway.recording.verify import verify
from gateway.records import Raw, Record, Status
from gateway.service import Service
from monitor.comparison import Comparison
from monitor.scans import Scan
from monitor.verdict import Verdict
from simulators.outlets import PtyOutlet
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live, recorded_bytes, records, wait_until
from tests.gateway.shell import GATEWAY, Running


@pytest.fixture
def line() -> Iterator[PtyOutlet]:
    with PtyOutlet() as outlet:
        yield outlet


class Background:
    """A service that runs by itself in a thread, as `shadebus run` has it."""

    def __init__(self, config: RackConfig, **changes: Any) -> None:
        self.events: list[Event] = []
        self.service = Service(config, None, **{"emit": self.events.append, **changes})
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.service.run_until, args=(self.stop,))

    def states(self, adapter: str) -> list[str]:
        return [str(vars(e)["state"]) for e in list(self.events) if vars(e).get("adapter") == adapter]

    def __enter__(self) -> "Background":
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop.set()
        self.thread.join(20)
        assert not self.thread.is_alive()


def recorder_that_raises(monkeypatch: pytest.MonkeyPatch, error: Exception, after: int) -> None:
    class Failing(Recorder):
        appended = 0

        def append(self, records: Sequence[Record]) -> None:
            self.appended += 1
            if self.appended > after:
                raise error
            super().append(records)

    monkeypatch.setattr(keeper, "Recorder", Failing)


def test_a_full_disk_stops_the_recording_loudly_and_the_decoding_goes_on(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder_that_raises(monkeypatch, OSError(errno.ENOSPC, "No space left on device"), after=3)
    monkeypatch.setattr(keeper, "LOOK_NS", 1 << 60)  # and no second attempt
    with Background(make_rack(f"serial:{line.path}")) as gateway:
        wait_until(lambda: "UP" in gateway.states("bridge"), "UP")
        line.write(stream)
        wait_until(lambda: sum(event.type == "scan" for event in gateway.events) == 2, "two scans")
        wait_until(lambda: gateway.states("recording") == ["FAILED"], "the failure is told")
    stopped, lost = gateway.service.failures
    assert "recording stopped" in stopped
    assert "No space left on device; make room" in stopped
    assert "records were not recorded" in lost
    assert not gateway.service.broken.is_set()


def test_a_journal_that_dies_ends_the_gateway_and_is_named(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder_that_raises(monkeypatch, ValueError("defect"), after=3)
    with Background(make_rack(f"serial:{line.path}")) as gateway:
        wait_until(lambda: "UP" in gateway.states("bridge"), "UP")
        line.write(stream[:500])
        gateway.thread.join(20)  # by itself: nobody has asked it to stop
        assert not gateway.thread.is_alive()
    assert gateway.service.broken.is_set()
    assert gateway.service.failures == ["thread journal died: ValueError: defect"]


class Dying:
    """A driver that ends its thread as no ordinary error does."""

    def open(self) -> Port:
        raise SystemExit("driver gave up")


def test_an_adapter_thread_that_dies_ends_the_gateway_and_is_named(
    make_rack: MakeRack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service_module, "make_adapter", lambda _: Dying())
    with Background(make_rack(wait_for_devices=True)) as gateway:
        gateway.thread.join(20)
        assert not gateway.thread.is_alive()
    assert gateway.service.failures == ["thread adapter bridge died: SystemExit: driver gave up"]
    died = [record for record in records(path_of(gateway)) if isinstance(record, Status) and record.state == "DIED"]
    assert [record.adapter for record in died] == ["adapter bridge"]


def path_of(gateway: Background) -> Path:
    assert gateway.service.recording_path is not None
    return gateway.service.recording_path


def test_a_core_that_dies_ends_the_gateway_and_the_recording_is_whole(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    released = threading.Event()

    def run(*_: object) -> None:
        released.wait(20)
        raise MemoryError("no room for kernels")

    monkeypatch.setattr("gateway.core.CoreQueue.run", run)
    with Background(make_rack(f"serial:{line.path}")) as gateway:
        line.write(stream)
        wait_until(lambda: len(recorded_bytes(path_of(gateway))) == len(stream), "all recorded")
        released.set()
        gateway.thread.join(20)
        assert not gateway.thread.is_alive()
    assert gateway.service.failures == ["thread core died: MemoryError: no room for kernels"]
    assert recorded_bytes(path_of(gateway)) == stream


def test_a_pipeline_that_breaks_is_recorded_rebuilt_and_judges_on(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes
) -> None:

    rack = make_rack(f"serial:{line.path}", terrain=[TERRAIN])
    seen: list[Scan] = []

    def watch(scan: Scan, verdict: Verdict, comparison: Comparison | None) -> None:
        seen.append(scan)
        if len(seen) == 1:
            raise ZeroDivisionError("defect")

    events: list[Event] = []
    service = Service(rack, build_monitor(rack), events.append, watch)
    service.start()
    line.write(stream)
    wait_until(lambda: any(vars(event).get("state") == "FAILED" for event in events), "the failure is told")
    line.write(stream)
    wait_until(lambda: any(event.type == "integrity" for event in events), "a verdict after the failure")
    path = service.recording_path
    assert path is not None
    wait_until(lambda: len(recorded_bytes(path)) == 2 * len(stream), "all recorded")
    service.stop()
    assert len(service.failures) == 1
    assert "ZeroDivisionError: defect" in service.failures[0]
    assert not service.broken.is_set()
    failed = [r for r in records(path) if isinstance(r, Status) and r.adapter == "core"]
    assert [(record.state, "ZeroDivisionError" in record.reason) for record in failed] == [("FAILED", True)]
    assert recorded_bytes(path) == 2 * stream


def test_a_listener_that_raises_is_recorded_once_and_the_recording_is_whole(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes
) -> None:
    def gone(event: Event) -> None:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    with Background(make_rack(f"serial:{line.path}"), emit=gone) as gateway:
        line.write(stream)
        wait_until(lambda: len(recorded_bytes(path_of(gateway))) == len(stream), "all recorded")
    assert len(gateway.service.failures) == 1
    found = records(path_of(gateway))
    assert [r.state for r in found if isinstance(r, Status) and r.adapter == "core"] == ["FAILED"]
    assert b"".join(record.data for record in found if isinstance(record, Raw)) == stream


def test_a_device_that_cannot_be_opened_stops_everything_at_once(make_rack: MakeRack) -> None:

    rack = make_rack("serial:/dev/no-such-line")
    with pytest.raises(GatewayError, match="no such device"), Live(rack):
        pytest.fail("it started")
    assert [thread.name for thread in threading.enumerate() if "bridge" in thread.name] == []


def test_writes_that_really_fail_are_told_and_counted_and_recording_goes_on_in_another_file(
    line: PtyOutlet, stream: bytes, tmp_path: Path
) -> None:
    limit = 30_000
    source = ("--source", f"serial:{line.path}", "--dem", TERRAIN, "--record", tmp_path)
    with Running(*source, largest_file=limit) as gateway:
        gateway.wait_for("status", state="UP")
        line.write(stream)
        gateway.wait_for("status", state="FAILED", adapter="recording")
        gateway.wait_for("status", state="LOST", adapter="recording")
        line.close()
        gateway.wait_for("status", state="LOST", adapter="bridge0")
        gateway.process.send_signal(signal.SIGTERM)
        assert gateway.end() == 1
        assert "records were not recorded" in gateway.errors
        assert "Traceback" not in gateway.errors
        told = [event for event in map(json.loads, gateway.lines) if event.get("adapter") == "recording"]
    assert any("File too large; make room" in event["reason"] for event in told if event["state"] == "FAILED")
    (first, *_) = sorted(tmp_path.glob("*.mcap"), key=lambda path: len(path.name))
    recording = Recording(first)
    assert len(recording.files) > 1
    assert all(path.stat().st_size <= limit for path in recording.files)
    lost = [record for record in recording if isinstance(record, Status) and record[2:4] == ("recording", "LOST")]
    missing = verify(recording).missing
    assert missing == sum(int(record.reason.split()[0]) for record in lost) > 0


def test_a_disk_that_is_full_from_the_start_is_one_line(line: PtyOutlet, tmp_path: Path) -> None:
    source = ("--source", f"serial:{line.path}", "--record", tmp_path)
    with Running(*source, largest_file=400) as gateway:
        assert gateway.end() == 1
        complaint = [text for text in gateway.errors.splitlines() if text.startswith("shadebus: ")]
        assert len(complaint) == 1
        assert "cannot record to" in complaint[0] and "File too large; choose another directory" in complaint[0]
        assert "Traceback" not in gateway.errors


def test_a_closed_standard_output_ends_no_recording_but_the_exit_tells(
    line: PtyOutlet, stream: bytes, tmp_path: Path
) -> None:
    command = [*GATEWAY, "run", "--json", "--source", f"serial:{line.path}", "--record", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as gateway:
        assert gateway.stdout is not None and gateway.stderr is not None
        gateway.stdout.readline()
        gateway.stdout.close()
        line.write(stream)
        wait_until(lambda: [*tmp_path.glob("*.mcap")], "a recording")
        (path,) = tmp_path.glob("*.mcap")
        wait_until(lambda: len(recorded_bytes(path, "bridge0")) == len(stream), "all recorded")
        gateway.send_signal(signal.SIGTERM)
        errors = gateway.stderr.read()
        assert gateway.wait(20) == 1
    assert "Broken pipe" in errors
    assert "Traceback" not in errors and "Exception" not in errors
    assert recorded_bytes(path, "bridge0") == stream


def test_a_full_device_as_standard_output_is_told(line: PtyOutlet, tmp_path: Path) -> None:
    command = [*GATEWAY, "run", "--json", "--for", "1", "--source", f"serial:{line.path}"]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert os.strerror(errno.ENOSPC) in done.stderr
    assert "Traceback" not in done.stderr and "Exception" not in done.stderr


def test_a_listener_that_stands_still_cannot_hold_the_gateway(
    line: PtyOutlet, make_rack: MakeRack, stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service_module, "LAST_WORDS_S", 0.2)
    moving, asked = threading.Event(), threading.Event()

    def stand_still(_: Event) -> None:
        asked.set()
        moving.wait(60)

    service = Service(make_rack(f"serial:{line.path}"), None, stand_still)
    service.start()
    line.write(stream[:1000])
    assert asked.wait(10)
    service.stop()
    assert service.stuck
    assert any("stands still" in failure for failure in service.failures)
    moving.set()
    path = service.recording_path
    assert path is not None
    assert stream.startswith(recorded_bytes(path))


def test_a_driver_that_never_comes_back_is_left_behind_and_told(
    line: PtyOutlet, make_rack: MakeRack, monkeypatch: pytest.MonkeyPatch
) -> None:
    entered, release = threading.Event(), threading.Event()

    class Stuck:
        def open(self) -> Port:
            entered.set()
            release.wait(60)
            raise OSError("at last")

    monkeypatch.setattr(service_module, "make_adapter", lambda _: Stuck())
    monkeypatch.setattr(service_module, "DRIVER_S", 0.2)
    config = make_rack(f"serial:{line.path}", wait_for_devices=True)
    with Background(config) as gateway:
        wait_until(entered.is_set, "opening")
    release.set()
    assert gateway.service.failures == ["adapter bridge: its driver does not come back; it is left behind"]
    assert [record.state for record in records(path_of(gateway)) if isinstance(record, Status)] == ["OPENING", "CLOSED"]
