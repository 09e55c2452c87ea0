"""The README's commands do what it says, as they are written there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

from simulators.outlets import PtyOutlet
from simulators.player import play
from tests.gateway.shell import START_S, Running

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
COMMANDS = [
    line.strip()
    for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    for line in re.sub(r"\\\n", "", block).splitlines()
]


def command(begin: str) -> str:
    (found,) = (line for line in COMMANDS if line.startswith(begin))
    return found


def test_every_file_that_the_readme_points_to_is_there() -> None:
    named = set(re.findall(r"\]\(([^)]+)\)", README)) | {
        word
        for line in COMMANDS
        for word in shlex.split(line, comments=True)
        if re.match(r"(simulators|examples)/", word)
    }
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []


def test_the_run_and_replay_of_the_readme_give_calibrated_verdicts(
    flight: list[tuple[int, bytes]], tmp_path: Path
) -> None:
    with PtyOutlet() as line:
        _, _, *words = shlex.split(command("shadebus run").replace("/dev/pts/5", line.path))
        places = {"recordings": tmp_path / "recordings"}
        arguments = [places.get(word, ROOT / word if word.startswith("simulators/") else word) for word in words]
        with Running(*arguments) as gateway:
            gateway.wait_for("status", state="UP")
            play(flight, line, 20.0)
            gateway.wait_for("integrity", verdict="ok", calibration="demo-white-mountains")
            gateway.process.terminate()
            assert gateway.end() == 0, gateway.errors
    gateway_again = f"{sys.executable} -m gateway"
    replay = command("shadebus replay").replace("shadebus", gateway_again, 1)
    again = subprocess.run(
        ["bash", "-c", replay], cwd=tmp_path, capture_output=True, text=True, timeout=START_S, check=True
    )
    assert ": OK " in again.stdout
