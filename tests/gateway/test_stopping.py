"""Ctrl-C and SIGTERM end every verb soon, with the exit code that a shell expects and without a traceback."""

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.config import check_config
from gateway.metadata import describe
from gateway.recording import Recorder
from gateway.records import Raw, Record
from gateway.stopping import PATIENCE_S
from tests.gateway.live import wait_until
from tests.gateway.made import stamp, tick
from tests.gateway.shell import GATEWAY

SOON_S = PATIENCE_S + 3.0  # a kernel that is being compiled takes all the patience


@pytest.fixture(scope="module")
def long_recording(stream: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Minutes of traffic and hours of waiting: no verb comes to its end by itself while a test looks."""
    config = check_config({"adapters": [{"name": "bridge", "source": "serial:x"}]}, "test")
    recorder = Recorder(tmp_path_factory.mktemp("long") / "a.mcap", describe(config, None))
    records: list[Record] = [tick(0, 0.0), tick(1, 1.0)]
    records += [Raw(2 + k, stamp(10_000.0 + k), "bridge", stream, 0) for k in range(300)]
    recorder.append(records)
    recorder.close()
    return recorder.path


def at_work(*arguments: str | Path) -> "subprocess.Popen[bytes]":
    """A verb whose kernels are loaded and whose handlers stand, as its open recording shows."""
    process = subprocess.Popen([*GATEWAY, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        wait_until(lambda: holds_a_recording(process.pid), "an open recording")
    except BaseException:
        process.kill()
        process.communicate()
        raise
    return process


def holds_a_recording(process_id: int) -> bool:
    for file in Path(f"/proc/{process_id}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed since it was listed
            if file.readlink().suffix == ".mcap":
                return True
    return False


@pytest.mark.parametrize(
    ("verb", "number", "code"),
    [
        (("replay",), signal.SIGINT, 130),
        (("replay", "--json", "--speed", "1"), signal.SIGTERM, 143),
        (("info",), signal.SIGTERM, 143),
        (("dump",), signal.SIGINT, 130),
    ],
)
def test_a_verb_ends_soon(verb: tuple[str, ...], number: signal.Signals, code: int, long_recording: Path) -> None:
    with at_work(*verb, long_recording) as process:
        assert process.stdout is not None and process.stderr is not None
        eater = threading.Thread(target=process.stdout.read)
        eater.start()
        time.sleep(0.1)
        began = time.monotonic()
        process.send_signal(number)
        errors = process.stderr.read()
        assert process.wait(20) == code
        assert time.monotonic() - began < SOON_S
        eater.join()
    assert errors == b""


def test_a_reader_that_stands_still_does_not_hold_a_verb(long_recording: Path) -> None:
    with at_work("dump", long_recording) as process:
        time.sleep(0.5)  # the pipe is full, and nobody reads it
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 143


@pytest.mark.parametrize(("number", "kill", "code"), [(signal.SIGINT, os.killpg, 130), (signal.SIGTERM, os.kill, 143)])
def test_a_demo_that_is_stopped_leaves_no_gateway_behind(
    number: signal.Signals, kill: Callable[[int, int], None], code: int, tmp_path: Path
) -> None:
    """Ctrl-C goes to all processes of the terminal's group, SIGTERM to one."""
    command = [*GATEWAY, "demo", "--out", str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as demo:
        assert demo.stderr is not None
        wait_until(lambda: [*tmp_path.glob("true/*.mcap")], "a recording")
        assert gateways(tmp_path)
        began = time.monotonic()
        kill(demo.pid, number)
        errors = demo.stderr.read()
        assert demo.wait(20) == code
        assert time.monotonic() - began < 2 * SOON_S
    assert gateways(tmp_path) == []
    assert [text for text in errors.splitlines() if not text.startswith("recording to ")] == []


def gateways(directory: Path) -> list[str]:
    """The command lines of the gateways that run with a rack file in a directory."""
    listed = subprocess.run(["ps", "-ewwo", "args"], capture_output=True, text=True, timeout=20, check=True).stdout
    return [line for line in listed.splitlines() if f"gateway run -c {directory}/" in line]
