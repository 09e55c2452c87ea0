"""The shipped command as a process: what it prints live is what `replay` prints, and a kill costs nothing accepted."""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from simulators.outlets import Closed, PtyOutlet
from simulators.player import play
from tests.gateway.conftest import TERRAIN
from tests.gateway.live import recorded_bytes, replayed, wait_until
from tests.gateway.shell import Running, shadebus, within


def the_recording(directory: Path) -> Path:
    (path,) = directory.glob("*.mcap")
    return path


@pytest.fixture
def line() -> Iterator[PtyOutlet]:
    with PtyOutlet() as outlet:
        yield outlet


def start(line: PtyOutlet, directory: Path) -> Running:
    return Running("--source", f"serial:{line.path}", "--dem", TERRAIN, "--record", directory)


def test_run_and_replay_print_the_same_bytes(
    flight: list[tuple[int, bytes]], stream: bytes, line: PtyOutlet, tmp_path: Path
) -> None:
    with start(line, tmp_path) as gateway:
        gateway.wait_for("status", state="UP")
        play(flight, line, 20.0)
        line.close()
        gateway.wait_for("status", state="LOST")
        gateway.process.send_signal(signal.SIGTERM)
        assert gateway.end() == 0, gateway.errors
    path = the_recording(tmp_path)
    assert recorded_bytes(path, "bridge0") == stream
    again = shadebus("replay", path, "--json")
    assert (again.returncode, again.stderr) == (0, "")
    assert again.stdout == gateway.output.decode()
    assert again.stdout.count('"type":"integrity"') == 3
    late = within("replay", path, "--json", "--start", "0.4").stdout
    assert 0 < len(late) < len(again.stdout)
    assert again.stdout.endswith(late)

    info = within("info", path).stdout
    assert "closed with its index" in info
    assert f"{len(stream)} of them from the buses" in info
    assert str(TERRAIN) in info

    dump = within("dump", path)
    assert dump.stderr == ""
    counters = json.loads(gateway.lines[-1])["counters"]
    assert dump.stdout.count("  429  ") == counters["bridge0.words_429"] > 500
    assert dump.stdout.count("  708  ") == counters["bridge0.words_708"] > 100
    assert "GNSS latitude" in dump.stdout

    pipe = f"{sys.executable} -m gateway replay {path} --json | head -n 1; exit ${{PIPESTATUS[0]}}"
    head = subprocess.run(["bash", "-c", pipe], capture_output=True, text=True, timeout=60, check=False)
    assert head.stdout == gateway.lines[0] + "\n"
    assert "Traceback" not in head.stderr and "Exception" not in head.stderr

    person = within("replay", path)
    assert person.stdout.count("scan 0:") == 2
    assert "bins2" in person.stdout


def test_a_killed_gateway_leaves_a_recording_that_every_verb_reads(
    stream: bytes, line: PtyOutlet, tmp_path: Path
) -> None:
    many = stream * 12
    sent = [0]

    def send() -> None:
        for start_byte in range(0, len(many), 997):
            try:
                line.write(many[start_byte : start_byte + 997])
            except Closed:
                return
            sent[0] += 997

    sender = threading.Thread(target=send)
    with start(line, tmp_path) as gateway:
        gateway.wait_for("status", state="UP")
        sender.start()
        enough = len(many) // 3
        wait_until(lambda: sent[0] > enough and b'"scan"' in gateway.output, f"{enough} bytes sent and a scan seen")
        gateway.process.kill()
        assert gateway.end() == -signal.SIGKILL
        line.close()
        sender.join(10)
        printed = bytes(gateway.output).decode()
    path = the_recording(tmp_path)
    kept = recorded_bytes(path, "bridge0")
    assert many.startswith(kept)
    assert len(kept) > 0.5 * enough
    again = "".join(text + "\n" for text in replayed(path))
    assert again.startswith(printed)
    assert '"type":"summary"' not in printed
    assert "the file ends without its index" in within("info", path).stdout
    dump = shadebus("dump", path)
    assert dump.returncode == 0
    assert "the file ends without its index" in dump.stderr
    torn = shadebus("replay", path, "--json")
    assert torn.stdout == again
    assert "every whole record was replayed" in torn.stderr
