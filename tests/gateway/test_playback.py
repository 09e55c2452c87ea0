"""Replay in other ways than all at once: scan by scan, again and again, slower, under other names."""

import json
import os
import pty
import signal
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gateway.cli import app
from gateway.config import RackConfig, check_config
from gateway.errors import GatewayError
from gateway.events import Event, ScanEvent, SummaryEvent
from gateway.metadata import describe
from gateway.playback import names_of, renamed, speed_of
from gateway.recording import Recorder, Recording
from gateway.replay import replay
from tests.gateway.made import RACK, Bridge, only, raw, status, sweep, tick
from tests.gateway.shell import GATEWAY, START_S

PROMPT = "Enter for the next scan  "
TWO = check_config({"adapters": [{"name": name, "source": "serial:x"} for name in ("left", "right")]}, "test")


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Three sweeps of half a second, each followed by the next, over two seconds."""
    bridge = Bridge()
    recorder = Recorder(tmp_path / "a.mcap", describe(RACK, None))
    recorder.append([status(0, 0.0, "UP"), raw(1, 0.1, bridge.hello())])
    for k in range(3):
        recorder.append([raw(2 + 2 * k, 0.6 * (k + 1), sweep(bridge, 0.6 * k)), tick(3 + 2 * k, 0.6 * (k + 1))])
    recorder.close()
    return recorder.path


def played(path: Path, config: RackConfig = RACK, **options: Any) -> list[Event]:
    found: list[Event] = []
    failures: list[str] = []
    replay(Recording(path), config, None, found.append, failures.append, **options)
    assert failures == []
    return found


def kinds(lines: list[str]) -> list[str]:
    return [json.loads(line)["type"] for line in lines]


def test_a_step_comes_before_each_scan_and_changes_no_event(recording: Path) -> None:
    shown: list[Event] = []
    steps: list[int] = []
    failures: list[str] = []
    step = lambda _: steps.append(len(shown))  # noqa: E731
    replay(Recording(recording), RACK, None, shown.append, failures.append, step=step)
    assert shown == played(recording)
    assert steps == [k for k, event in enumerate(shown) if isinstance(event, ScanEvent)]
    assert len(steps) >= 3


@pytest.mark.parametrize(("start_s", "stop_s"), [(1.5, 0.5), (1.0, 1.0)])
def test_a_replay_cannot_stop_before_it_starts(recording: Path, start_s: float, stop_s: float) -> None:
    with pytest.raises(GatewayError, match=rf"--stop {stop_s} does not come after --start {start_s}: give a later"):
        played(recording, start_s=start_s, stop_s=stop_s)


def test_a_replay_of_a_pause_is_told_and_says_nothing_of_the_recording_s_length(recording: Path) -> None:
    with pytest.raises(GatewayError, match=r"a\.mcap has nothing from 0\.7 to 0\.9: `shadebus info` tells its times"):
        played(recording, start_s=0.7, stop_s=0.9)


def test_time_at_a_speed_stands_still_while_a_step_is_waited_for(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a clock that moves only when somebody waits on it."""
    now_ns = [0]
    monkeypatch.setattr("gateway.replay.time.monotonic_ns", lambda: now_ns[0])

    class Halt(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            now_ns[0] += round((timeout or 0.0) * 1e9)
            return False

    def step(_: threading.Event) -> None:
        now_ns[0] += 60_000_000_000

    scans = len(only(ScanEvent, played(recording, speed=0.5, stop=Halt(), step=step)))
    assert now_ns[0] == scans * 60_000_000_000 + 3_600_000_000  # 1.8 s at half the speed


def test_an_order_to_stop_while_a_step_is_waited_for_shows_nothing_more(recording: Path) -> None:
    stop = threading.Event()
    found = played(recording, stop=stop, step=lambda halt: halt.set())
    assert only(ScanEvent, found) == []
    assert only(SummaryEvent, found) == []


class Stepping:
    """`shadebus replay --step --json` on a pipe or a terminal; each line that it prints."""

    def __init__(self, path: Path, stdin: int) -> None:
        command = [*GATEWAY, "replay", str(path), "--step", "--json"]
        self.process = subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.lines: Iterator[str] = iter(self.process.stdout)

    def until(self, kind: str) -> list[str]:
        found: list[str] = []
        while not found or kinds(found)[-1] != kind:
            found.append(next(self.lines))
        return found

    def end(self) -> tuple[int, str]:
        _, told = self.process.communicate(timeout=START_S)
        return self.process.returncode, told


def test_each_line_of_a_pipe_shows_one_scan_and_its_end_all_the_rest(recording: Path) -> None:
    whole = [event.to_json() + "\n" for event in played(recording)]
    read, write = os.pipe()
    stepping = Stepping(recording, read)
    os.close(read)
    shown = stepping.until("status")
    os.write(write, b"\n\n")
    shown += stepping.until("scan") + stepping.until("scan")
    assert shown == whole[: len(shown)]
    os.close(write)
    shown += list(stepping.lines)
    assert (shown, stepping.end()) == (whole, (0, ""))


def test_at_a_terminal_enter_shows_the_next_scan_and_ctrl_c_ends_it(recording: Path) -> None:
    master, terminal = pty.openpty()
    stepping = Stepping(recording, terminal)
    os.close(terminal)
    assert stepping.process.stderr is not None
    assert stepping.process.stderr.read(len(PROMPT)) == PROMPT
    os.write(master, b"\n")
    assert stepping.process.stderr.read(len(PROMPT)) == PROMPT
    stepping.process.send_signal(signal.SIGINT)
    shown = list(stepping.lines)
    assert kinds(shown).count("scan") == 1
    assert "summary" not in kinds(shown)
    assert stepping.end() == (130, "")
    os.close(master)


def printed(*arguments: str | Path) -> str:
    """What a verb prints in this process."""
    done = CliRunner().invoke(app, [*map(str, arguments)])
    assert (done.exit_code, done.exception) == (0, None)
    return done.stdout


@pytest.mark.usefixtures("signals_left_alone")
def test_a_loop_begins_anew_each_time_and_prints_the_same_bytes_each_time(recording: Path) -> None:
    once = printed("replay", recording, "--json")
    assert kinds(once.splitlines())[-1] == "summary"
    assert printed("replay", recording, "--json", "--loop", "3") == 3 * once


def test_a_loop_without_end_ends_when_told(recording: Path) -> None:
    command = [*GATEWAY, "replay", str(recording), "--json", "--loop", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = [kinds([next(process.stdout)])[0] for _ in range(200)]
        process.send_signal(signal.SIGTERM)
        process.stdout.read()
    assert process.returncode == 143
    assert found.count("summary") > 2


@pytest.mark.usefixtures("signals_left_alone")
def test_a_loop_over_nothing_ends(tmp_path: Path) -> None:
    Recorder(tmp_path / "a.mcap", describe(RACK, None)).close()
    assert printed("replay", tmp_path / "a.mcap", "--loop", "0") == ""


@pytest.mark.usefixtures("signals_left_alone")
def test_an_adapter_of_another_name_is_called_so_everywhere(recording: Path) -> None:
    names = {"bridge": "bow"}
    plain, other = played(recording), played(recording, renamed(RACK, names), names=names)
    assert [event.to_json().replace('"bow', '"bridge') for event in other] == [event.to_json() for event in plain]
    assert '"bridge' not in "".join(event.to_json() for event in other)
    lines = printed("replay", recording, "--json", "--rename", "bridge=bow")
    assert lines == "".join(event.to_json() + "\n" for event in other)


def test_names_may_be_exchanged() -> None:
    assert [a.name for a in renamed(TWO, names_of(["left=right", "right=left"], TWO)).adapters] == ["right", "left"]


@pytest.mark.parametrize(
    ("texts", "complaint"),
    [
        (["left"], "--rename left: write OLD=NEW"),
        (["middle=x"], "--rename middle=x: no adapter is named 'middle', use one of left, right"),
        (["left=x", "left=y"], "--rename left=y: 'left' is to be 'x' already"),
        (["left=right"], "--rename: the whole: two adapters are named 'right'"),
        (["left=a/b"], "--rename: adapters.0.name: "),
        (["left=radar"], "--rename: adapters.0.name: 'radar' is what the gateway calls a part of itself"),
    ],
)
def test_a_name_that_cannot_be_is_refused(texts: list[str], complaint: str) -> None:
    with pytest.raises(GatewayError) as caught:
        renamed(TWO, names_of(texts, TWO))
    assert str(caught.value).startswith(complaint)


def test_a_speed_is_a_number_or_max() -> None:
    assert (speed_of("max"), speed_of("2.5"), speed_of("1e-3")) == (None, 2.5, 0.001)
    for text in ("fast", "0", "-1", "nan", "inf", ""):
        with pytest.raises(GatewayError, match=f"--speed {text}: write a number from 0.001, 1 being real time, or max"):
            speed_of(text)
