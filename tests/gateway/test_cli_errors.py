"""A mistake at the command line is one line on stderr that names the thing and the mend, and a non-zero exit."""

import grp
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

from gateway.config import check_config
from gateway.doctor.serial import permission_mend
from gateway.metadata import build_monitor, describe
from gateway.recording import Recorder
from simulators.outlets import PtyOutlet
from tests.gateway.conftest import TERRAIN
from tests.gateway.made import tick
from tests.gateway.shell import GATEWAY, shadebus, within

Arguments = list[str | Path]
# Nothing is forbidden to root, so the command gives its rights up, once it has loaded what only root may read.
AS_NOBODY = (
    sys.executable,
    "-c",
    """
import os
import gateway.adapters.serial, gateway.console, gateway.metadata, gateway.service
from gateway.cli import main
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
main()
""",
)
CHANNEL = """[adapters.channels.{}]
kind = "arinc708"
"""
BROKEN_LINK = Path(__file__).parents[2] / "examples" / "broken_link.toml"
RACK = '[[adapters]]\nname = "bridge"\nsource = "serial:/dev/no-such-line"\n'


def rack(directory: Path, text: str) -> Arguments:
    (directory / "rack.toml").write_text(text)
    return ["run", "-c", directory / "rack.toml"]


def file(directory: Path, content: bytes) -> Path:
    (directory / "file").write_bytes(content)
    return directory / "file"


def foreign_mcap(directory: Path) -> Path:
    path = directory / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="another")
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def without_configuration(directory: Path) -> Path:
    Recorder(directory / "odd.mcap", {"configuration": "{}"}).close()
    return directory / "odd.mcap"


def without_calibration(directory: Path) -> Path:
    config = check_config({"adapters": [{"name": "a", "source": "serial:x"}]}, "test")
    metadata = {key: text for key, text in describe(config, None).items() if key != "calibration"}
    Recorder(directory / "odd.mcap", metadata).close()
    return directory / "odd.mcap"


def scrap(directory: Path) -> Path:
    (directory / "scrap.mcap").write_bytes(a_second(directory).read_bytes()[:20])
    return directory / "scrap.mcap"


def a_second(directory: Path) -> Path:
    config = check_config({"adapters": [{"name": "a", "source": "serial:x"}]}, "test")
    recorder = Recorder(directory / "a.mcap", describe(config, None))
    recorder.append([tick(0, 0.0), tick(1, 1.0)])
    recorder.close()
    return recorder.path


def source(*more: str | Path) -> Arguments:
    return ["run", "--source", "serial:/dev/no-such-line", *more]


CASES: dict[str, tuple[Callable[[Path], Arguments], tuple[str, ...]]] = {
    "wrong port": (lambda d: source(), ("/dev/no-such-line", "no such device: plug it in")),
    "missing terrain": (lambda d: source("--dem", d / "no.tif"), ("no.tif does not exist", "check the path")),
    "no terrain": (lambda d: source("--dem", file(d, b"text")), ("file cannot be read as terrain", "GeoTIFF")),
    "no TOML": (lambda d: rack(d, "adapters = ["), ("rack.toml is not TOML",)),
    "missing rack": (lambda d: ["run", "-c", d / "no.toml"], ("no.toml", "No such file")),
    "unknown key": (lambda d: rack(d, RACK + "speed = 1"), ("rack.toml: adapters.0.speed", "there is no such option")),
    "bad value": (lambda d: rack(d, RACK + "[monitor]\np_fa = 2"), ("monitor.p_fa", "less than 0.5")),
    "unknown kind": (lambda d: ["run", "--source", "tin:can"], ("'tin:can': unknown kind 'tin'", "use one of serial")),
    "no source": (lambda d: ["run"], ("-c", "--source, such as serial:")),
    "missing recording": (lambda d: ["replay", d / "no.mcap"], ("no.mcap", "No such file")),
    "no recording": (lambda d: ["replay", file(d, b"text" * 99)], ("file is not a shadebus recording",)),
    "foreign recording": (lambda d: ["info", foreign_mcap(d)], ("foreign.mcap is an MCAP file, but not a shadebus",)),
    "odd metadata": (
        lambda d: ["dump", without_configuration(d)],
        ("odd.mcap holds no configuration", "look for another copy, or update"),
    ),
    "odd calibration": (
        lambda d: ["replay", without_calibration(d)],
        ("the recording holds no calibration", "shadebus reprocess -c", "look for another copy, or update"),
    ),
    "missing calibration": (
        lambda d: source("--dem", TERRAIN, "--calibration", d / "no.json"),
        ("calibration file", "no.json cannot be read: No such file"),
    ),
    "no calibration": (
        lambda d: source("--dem", TERRAIN, "--calibration", file(d, b"{}")),
        ("calibration file", "name: Field required"),
    ),
    "bad hexadecimal": (lambda d: ["decode", "429", "12g4"], ("'12g4' is not hexadecimal",)),
    "bad length": (lambda d: ["decode", "708", "b443"], ("'b443': 4 digits given, 16 to 512 needed",)),
    "half a byte": (lambda d: ["decode", "708", "b443047a0e80767c0"], ("17 digits given", "a digit is missing")),
    "a word in pieces": (
        lambda d: ["decode", "429", "e3", "20", "00", "a1"],
        ("'e3': 2 digits given, 8 needed: write all of them, and spaces within quotes",),
    ),
    "no word": (lambda d: ["decode", "429", ""], ("'': 0 digits given, 8 needed",)),
    "a digit short": (lambda d: ["decode", "429", "0Xe32000a"], ("'0Xe32000a': 7 digits given, 8", "is missing")),
    "unknown set": (lambda d: ["decode", "429", "00000001", "--set", "gps"], ("no definitions 'gps'", "gnss_743a")),
    "missing set": (lambda d: ["labels", "--set", d / "no.toml"], ("no.toml cannot be read: No such file",)),
    "half a configuration": (lambda d: ["thresholds", "--n", "60"], ("give all of --n",)),
    "source without port": (lambda d: ["run", "--source", "serial:socket://host"], ("socket://HOST:PORT",)),
    "source port too high": (
        lambda d: ["run", "--source", "serial:socket://127.0.0.1:99999"],
        ("serial line socket://127.0.0.1:99999: write", "from 1 to 65535"),
    ),
    "channel too high": (lambda d: rack(d, RACK + CHANNEL.format(999)), ("channels.999", "less than or equal to 255")),
    "channel below 0": (lambda d: rack(d, RACK + CHANNEL.format(-1)), ("channels.-1", "write plain digits, 0 to 255")),
    "scrap of a recording": (lambda d: ["info", scrap(d)], ("scrap.mcap is not", "it ends before its first record")),
    "start past the end": (
        lambda d: ["replay", "--start", "5", a_second(d)],
        ("a.mcap is only 1.0 s long: start before its end",),
    ),
    "no port": (lambda d: ["simulate", "--to", "tcp:x"], ("--to tcp:x: 'x' is no port", "use 1 to 65535")),
    "port too high": (lambda d: ["simulate", "--to", "tcp:99999"], ("'99999' is no port", "use 1 to 65535")),
    "full file": (
        lambda d: ["simulate", "--to", "file:/dev/full", "--duration", "1"],
        ("--to file:/dev/full: No space left on device: choose another",),
    ),
    "demo without a place": (lambda d: ["demo", "--out", "/proc/no"], ("cannot write to /proc/no", "with --out")),
    "nothing to unplug": (
        lambda d: ["simulate", BROKEN_LINK, "--to", f"file:{d / 'out'}"],
        (": this cannot be unplugged", "choose pty, tcp or slcan"),
    ),
    "unknown outlet": (
        lambda d: ["simulate", "--to", "tin"],
        ("--to tin: use pty, pty:LINK, tcp:PORT, file:PATH, udp:",),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_one_line_that_names_it_and_the_mend(case: str, tmp_path: Path) -> None:
    arguments, fragments = CASES[case]
    done = within(*arguments(tmp_path))
    assert done.returncode == 1
    complaint, *more = [text for text in done.stderr.splitlines() if not text.startswith("no terrain given")]
    assert more == []
    assert complaint.startswith("shadebus: ")
    assert [fragment for fragment in fragments if fragment not in complaint] == [], complaint


def test_a_line_without_permission_is_named_with_the_group_to_join() -> None:
    with PtyOutlet() as line:
        Path(line.path).chmod(0)
        command = [*AS_NOBODY, "run", "--source", f"serial:{line.path}"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert f"{line.path}: no permission: add yourself to the dialout group" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_start_that_failed_leaves_no_recording(tmp_path: Path) -> None:
    assert within(*source("--record", tmp_path)).returncode == 1
    assert [*tmp_path.iterdir()] == []


def test_a_simulation_that_failed_leaves_no_file(tmp_path: Path) -> None:
    scenario = file(
        tmp_path,
        b"""
[flight]
latitude_deg = 0.0
longitude_deg = 0.0
height_m = 761.0
heading_deg = 197.6
""",
    )
    done = within("simulate", scenario, "--to", f"file:{tmp_path / 'out'}")
    assert done.returncode == 1
    assert done.stderr.startswith("shadebus: simulation: ")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_simulation_that_nobody_reads_says_so_once_and_ends_when_told() -> None:
    command = [*GATEWAY, "simulate", "--speed", "50"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as simulation:
        assert simulation.stdout is not None and simulation.stderr is not None
        place = simulation.stdout.readline().strip()
        assert simulation.stderr.readline() == f"{place} is full: waiting for a reader\n"
        simulation.send_signal(signal.SIGINT)
        assert simulation.stderr.read() == ""
        assert simulation.wait(20) == 0


def test_terrain_without_permission_is_named(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0)
    dem = tmp_path / "closed" / "a.hgt"
    done = subprocess.run(
        [*AS_NOBODY, *map(str, source("--dem", dem))], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert done.stderr == f"shadebus: terrain file {dem} may not be read: give this user the right to read it\n"


@pytest.mark.parametrize("arguments", ["--help", "thresholds", "decode 708 b443047a0e80767c", "simulate"])
def test_a_full_standard_output_is_named(arguments: str) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*GATEWAY, *arguments.split()], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False
        )
    assert done.returncode == 1
    assert done.stderr == "shadebus: standard output: No space left on device; choose another place for it\n"


def test_a_closed_standard_output_is_named() -> None:
    command = f"{sys.executable} -m gateway run --source serial:/dev/ptmx --for 1 >&-"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert done.stderr == "shadebus: standard output is closed: send it to a file, a pipe or /dev/null\n"


def test_a_run_that_records_nothing_ends_without_a_word_when_its_reader_leaves() -> None:
    pipe = f"{sys.executable} -m gateway run --source serial:/dev/ptmx | head -n 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", pipe], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.endswith("  bridge0: OPENING\n")
    assert (done.returncode, done.stderr) == (1, "no terrain given: scans and state only, no verdicts\n")


def test_nobody_is_told_to_join_the_group_of_root() -> None:
    mend = permission_mend(Path("/dev/null"))
    assert mend.startswith(
        """echo 'KERNEL=="null[0-9]*", GROUP="dialout", MODE="0660"' | sudo tee /etc/udev/rules.d/"""
    )
    assert "-aG root" not in mend


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives a file to a group that it is not in")
def test_another_group_is_to_be_joined(tmp_path: Path) -> None:
    os.chown(file(tmp_path, b""), -1, grp.getgrnam("tty").gr_gid)
    assert permission_mend(tmp_path / "file") == "sudo usermod -aG tty $USER, then log in again"


def test_a_directory_without_permission_is_named(tmp_path: Path) -> None:
    with PtyOutlet() as line:
        done = within("run", "--source", f"serial:{line.path}", "--record", "/proc/no-such-directory")
    assert done.returncode == 1
    assert "shadebus: cannot record to /proc/no-such-directory/" in done.stderr
    assert "choose another directory" in done.stderr


def test_terrain_that_changed_since_the_recording_is_named(tmp_path: Path) -> None:
    dem = tmp_path / TERRAIN.name
    dem.write_bytes(TERRAIN.read_bytes())
    config = check_config({"adapters": [{"name": "a", "source": "serial:x"}], "terrain": [dem]}, "test")
    Recorder(tmp_path / "a.mcap", describe(config, build_monitor(config))).close()
    content = bytearray(dem.read_bytes())
    content[1000] ^= 1
    dem.write_bytes(content)
    done = within("replay", tmp_path / "a.mcap")
    assert done.returncode == 1
    assert f"{dem} changed since the recording was made: name the terrain to use with --dem" in done.stderr
    assert within("replay", tmp_path / "a.mcap", "--dem", TERRAIN).returncode == 0


def test_the_module_and_the_installed_command_are_the_same() -> None:
    command = Path(sys.executable).with_name("shadebus")
    done = subprocess.run([command, "decode", "708", "zz"], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (1, shadebus("decode", "708", "zz").stderr)
    assert done.stderr == within("decode", "708", "zz").stderr
