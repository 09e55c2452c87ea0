"""The verb: what it writes, what it says that it left out, and what it never does."""

import struct
import subprocess
from pathlib import Path

import pytest

from gateway.errors import GatewayError
from gateway.exports import FORMATS, export
from gateway.recording import Recorder, Recording
from gateway.stopping import Stop
from tests.gateway.exports.recorded import TERRAIN, Flown, To, record
from tests.gateway.made import IRU, RACK, Bridge, raw
from tests.gateway.shell import GATEWAY, START_S, limited, shadebus, within


def test_the_verb_says_what_it_wrote(flown: Flown, tmp_path: Path) -> None:
    path = tmp_path / "words.csv"
    done = shadebus("export", flown.path, "--to", "csv", "-o", path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{path}: {len(flown.words)} ARINC 429 words; radar words have no place in it\n"


@pytest.mark.parametrize("form", FORMATS)
def test_what_is_there_is_never_written_over(form: str, flown: Flown, tmp_path: Path, to: To) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(GatewayError, match="out exists already: choose another path with -o, or move it away"):
        to(flown.path, form)
    assert (tmp_path / "out").read_text() == "mine"


def test_a_disk_that_is_full_is_one_line_and_leaves_nothing_behind(flown: Flown, tmp_path: Path) -> None:
    command = [*limited(20_000), *GATEWAY, "export", str(flown.path), "--to", "cfradial", "-o", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START_S, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert f"cannot write {tmp_path / 'out'}: NetCDF: " in done.stderr
    assert [*tmp_path.iterdir()] == []


def test_dump_shows_the_words_of_one_label_of_a_channel(flown: Flown) -> None:
    done = within("dump", flown.path, "--label", "314", "--adapter", "bridge", "--channel", "1")
    lines = done.stdout.splitlines()
    reversed_label = int(f"{0o314:08b}"[::-1], 2)
    assert len(lines) == sum(isinstance(one.word, int) and one.word & 0xFF == reversed_label for one in flown.of(1))
    assert all(" bridge   1  429 " in line and " 314 " in line for line in lines)


@pytest.mark.parametrize("form", FORMATS)
def test_a_torn_recording_is_exported_up_to_its_end_and_that_is_said(
    form: str, flown: Flown, tmp_path: Path, to: To
) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(flown.path.read_bytes()[:60_000])
    path, said = to(torn, form)
    assert path.exists()
    assert said[-1].startswith("the file ends without its index after ")
    assert said[-1].endswith("every whole record is in")


@pytest.mark.parametrize("form", FORMATS)
def test_a_damaged_record_is_left_out_and_counted(form: str, tmp_path: Path, to: To) -> None:
    bridge = Bridge()
    chunks = [bridge.hello(), bridge.words(IRU, 1.0, [0xE00190A1]), bridge.words(IRU, 2.0, [0x600C808B])]
    path = record(tmp_path / "r.mcap", RACK, [raw(k, k, chunk) for k, chunk in enumerate(chunks)])
    data = path.read_bytes()
    path.write_bytes(data.replace(struct.pack("<I", 0xE00190A1), struct.pack("<I", 0xE00190A0)))
    assert path.read_bytes() != data
    said = "the recording has 1 damaged place, 1 missing record; every whole record is in"
    assert said in to(path, form)[1]


@pytest.mark.parametrize("form", FORMATS)
def test_an_export_that_is_stopped_leaves_nothing_behind(form: str, flown: Flown, tmp_path: Path, stop: Stop) -> None:
    stop.exit_code = 130
    stop.set()
    try:
        with pytest.raises(SystemExit):
            export(flown.path, form, tmp_path / "out", stop)
    finally:
        stop.clear()
    assert [*tmp_path.iterdir()] == []


def test_what_cannot_be_written_or_is_not_known_is_named(flown: Flown, tmp_path: Path, stop: Stop) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "half.part").touch()
    for form, name, complaint in (
        ("excel", "out", "no format 'excel': name one of cfradial, chapter10, parquet, candump, csv"),
        ("csv", "file/out", "file/out: "),
        ("csv", "half", "half.part exists already"),
    ):
        with pytest.raises(GatewayError, match=complaint):
            export(flown.path, form, tmp_path / name, stop)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "half.part"]


def test_a_recording_whose_terrain_has_gone_is_exported_without_it(
    flown: Flown, tmp_path: Path, to: To, stop: Stop
) -> None:
    elsewhere = tmp_path / "elsewhere.mcap"
    source = Recording(flown.path)
    gone = {
        name: text.replace(TERRAIN.name, TERRAIN.name.replace("N44", "N99")) for name, text in source.metadata.items()
    }
    recorder = Recorder(elsewhere, gone)
    recorder.append(list(source))
    recorder.close()
    with pytest.raises(GatewayError, match=r"N99W072.hgt does not exist"):
        export(elsewhere, "parquet", tmp_path / "tables", stop)
    words = f"{len(flown.words)} labels, {len(flown.radar)} radials"
    assert to(elsewhere, "parquet", without_terrain=True)[1][0].endswith(f"{words}, 0 disparities, 3 verdicts")
    said = export(elsewhere, "parquet", tmp_path / "tables", stop, (TERRAIN,))
    assert said[0].startswith(f"{tmp_path / 'tables'}: {words}, ")
    assert "0 disparities" not in said[0]
