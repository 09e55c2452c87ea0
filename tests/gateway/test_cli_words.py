"""What the small verbs print."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gateway.cli import app
from simulators import arinc429
from tests.decoders.bus import word429
from tests.gateway.shell import shadebus, within

HEAVY = ("numpy", "numba", "scipy", "rasterio", "mcap", "matplotlib", "serial", "pydantic")
VERBS = (
    "demo",
    "run",
    "simulate",
    "replay",
    "import",
    "dump",
    "export",
    "info",
    "labels",
    "thresholds",
    "devices",
    "doctor",
    "calibrate radar",
    "calibrate dem",
    "decode 429",
    "decode 708",
)


def rows(text: str) -> list[list[str]]:
    """The cells of a printed table; of a Markdown one with its head."""
    lines = [line.strip().replace("|", "│") for line in text.splitlines()]
    found = [[cell.strip() for cell in line.strip("│").split("│")] for line in lines if line.startswith("│")]
    return [row for row in found if not row[0].startswith("--")]


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom gateway.cli import app\ntry:\n    app(['--help'])\nexcept SystemExit as done:\n"
        f"    print('loaded:', sorted({set(HEAVY)!r} & sys.modules.keys()), done.code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "loaded: [] 0"
    for verb in VERBS:
        assert verb.split()[0] in done.stdout


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb: str) -> None:
    done = CliRunner().invoke(app, [*verb.split(), "--help"])
    assert done.exit_code == 0
    assert "Usage" in done.output
    assert "--help" in done.output


def test_a_radar_header_is_explained_field_by_field() -> None:
    done = shadebus("decode", "708", "b443047a0e80767c")
    assert done.returncode == 0
    assert rows(done.stdout) == [
        ["field", "bits", "code", "value", "unit", "note"],
        ["label", "0-7", "00101101", "055", "octal", ""],
        ["control_accept", "8-9", "11", "both indicators", "", ""],
        ["slave", "10", "0", "master", "", ""],
        ["spare_11_12", "11-12", "00", "", "", ""],
        ["annunciations", "13-17", "00010", "weather_alert", "", ""],
        ["faults", "18-24", "0000001", "cooling", "", ""],
        ["stabilised", "25", "1", "on", "", ""],
        ["mode", "26-28", "110", "weather_turbulence", "", ""],
        ["tilt", "29-35", "1110011", "-3.25", "deg", ""],
        ["gain", "36-41", "000000", "0", "dB", "maximum"],
        ["range", "42-47", "100000", "160", "NM", ""],
        ["spare_48", "48", "0", "", "", ""],
        ["data_accept", "49-50", "11", "any", "", ""],
        [
            "scan_angle",
            "51-62",
            "111110001110",
            "-10.020",
            "deg",
            "clockwise from the nose",
        ],
        ["spare_63", "63", "0", "", "", ""],
        ["bins", "64-1599", "", "", "", "not shown: 8 bytes, of 200"],
    ]


def test_a_whole_radar_word_has_its_bins_counted_by_level() -> None:
    word = "b443047a0e80767c" + "ff" * 3 + "00" * 189
    found = rows(within("decode", "708", word).stdout)[16:]
    assert found == [
        ["bins", "64-1599", "", "512", "", "of 3 bits, 578.8 m each"],  # 160 NM of 1852 m
        ["black", "", "000", "504", "bins", ""],
        ["heavy_turbulence", "", "111", "8", "bins", ""],
    ]


def test_what_is_unusual_in_a_radar_word_is_noted() -> None:
    bits = 0o057 | 7 << 26 | 1 << 12 | 1 << 48 | 1 << 63  # label 364 in wire order
    word = bits.to_bytes(8, "little").hex() + "05" + "00" * 191
    notes = {row[0]: row[5] for row in rows(within("decode", "708", word).stdout) if "UNUSUAL" in row[5]}
    spare, reserved = "UNUSUAL: a spare bit is set", "UNUSUAL: a reserved code"
    assert notes == {
        "label": "UNUSUAL: arinc708 has 055, 057",
        "spare_11_12": spare,
        "mode": reserved,
        "spare_48": spare,
        "spare_63": spare,
        "reserved": reserved,
    }


def test_a_radar_word_is_explained_by_a_profile_of_ones_own(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text('[own]\nextends = "arinc708a"\nscan_angle_zero = "tail"\nscan_angle_sense = "counterclockwise"\n')
    header = (0xB4 | 7 << 26 | 1024 << 51).to_bytes(8, "little").hex()
    found = {row[0]: row[3:] for row in rows(within("decode", "708", header, "--profile", own).stdout)}
    assert found["mode"] == ["windshear_icon", "", ""]
    assert found["scan_angle"] == ["+90.000", "deg", "clockwise from the nose; sent counterclockwise from the tail"]


def test_a_mistake_in_a_profile_of_ones_own_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('[own]\nextends = "arinc708"\nbin = 3\n')
    for name, complaint in (("own.toml", "own.toml:3 [own] bin: Unexpected"), ("no.toml", "no.toml cannot be read")):
        done = within("decode", "708", "b443047a0e80767c", "--profile", tmp_path / name)
        assert done.returncode == 1
        assert complaint in done.stderr
        assert done.stderr.count("\n") == 1


def test_arinc_429_words_are_explained_field_by_field() -> None:
    good, bad = arinc429.encode(0o324, -2.5), arinc429.encode(0o324, -2.5) ^ 1 << 31
    done = within("decode", "429", f"{good:08x}", f"0X{bad:08X}")
    assert done.returncode == 0
    found = [row for row in rows(done.stdout) if row[0] != "field"]
    names = [row[0] for row in found]
    assert names == 2 * ["label", "SDI", "data", "SSM", "parity", "value"]
    first, second = ({row[0]: row[1:] for row in part} for part in (found[:6], found[6:]))
    assert first["label"][1:] == ["324", "Pitch angle"]
    assert first["SSM"][1:] == ["11", "NORMAL"]
    assert first["parity"][2] == "odd, good"
    value, units = first["value"][1].split()
    assert float(value) == pytest.approx(-2.5, abs=0.01)
    assert units == "deg"
    assert "BAD" in second["parity"][2]
    assert first["value"][2] == "NORMAL, positive is nose up"
    assert second["value"][1:] == ["none", "BAD_PARITY, positive is nose up"]


def test_a_label_that_the_set_does_not_have_is_said_to_be_unknown() -> None:
    found = {row[0]: row[1:] for row in rows(within("decode", "429", "00 00 00 00", "--set", "ra_707").stdout)}
    assert found["label"][2] == "not in ra_707"
    assert found["SDI"][2] == found["SSM"][2] == "depends on the label"
    assert found["value"][1] == "none"


def test_what_a_word_or_a_label_file_says_is_printed_as_it_stands(tmp_path: Path) -> None:
    """Square brackets and colons mean something to the library that draws the tables."""
    own = tmp_path / "own.toml"
    row = "name = '[b]Roll[/] [deg]', encoding = 'iso5', bits = [9, 29], source = '[/p. 3]', confidence = ':x:'"
    own.write_text(f"[own]\nequipment_id = 1\nrows = [{{ label = '356', {row} }}]\n")
    (listed,) = rows(within("labels", "--set", own).stdout)[1:]
    assert (listed[1], listed[-2:]) == ("[b]Roll[/] [deg]", [":x:", "[/p. 3]"])
    for said in ("[/]", "[b]", ":x:"):
        text = sum(ord(character) << 7 * k for k, character in enumerate(said))
        word = word429(0o356, {9: (text, 21)})
        done = within("decode", "429", f"{word:08x}", "--set", own)
        assert {row[0]: row[3] for row in rows(done.stdout)}["value"] == "NORMAL"
        assert {row[0]: row[2] for row in rows(done.stdout)}["value"] == repr(said)


def test_doctor_prints_the_names_of_places_as_they_stand(tmp_path: Path) -> None:
    place = tmp_path / "[" / ":x:]"
    place.mkdir(parents=True)
    assert str(place) in within("doctor", "--record", place).stdout


def test_thresholds_are_those_of_the_published_table() -> None:
    found = rows(within("thresholds").stdout)
    assert found == [
        ["60", "2", "1e-01", "1e-05", "74.40", "3.53"],
        ["60", "2", "1e-03", "1e-03", "99.61", "3.70"],
        ["60", "2", "1e-05", "1e-01", "118.58", "3.38"],
        ["120", "4", "1e-01", "1e-05", "140.23", "5.64"],
        ["120", "4", "1e-03", "1e-03", "173.62", "5.92"],
        ["120", "4", "1e-05", "1e-01", "197.83", "5.43"],
    ]


def test_thresholds_of_ones_own_configuration() -> None:
    done = within("thresholds", "--n", "60", "--n", "120", "--sigma-c", "2", "--p-fa", "1e-3", "--p-md", "1e-3")
    found = rows(done.stdout)
    assert [row[0] for row in found] == ["60", "120"]
    assert found[0][4:] == ["99.61", "3.70"]


def test_doctor_looks_at_everything_and_its_exit_code_is_its_finding(tmp_path: Path) -> None:
    done = shadebus("doctor", "--record", tmp_path)
    found = {row[0]: row[1:] for row in rows(done.stdout)}
    assert [*found] == [
        "Python",
        "libraries",
        "kernel cache",
        "serial lines",
        "serial permission",
        "serial latency",
        "USB permission",
        "socket buffers",
        "CAN interfaces",
        "disk room",
        "disk writes",
        "clock",
    ]
    lacking = [name for name, (mark, *_) in found.items() if mark == "lacks"]
    assert done.returncode == (1 if lacking else 0)
    mended = re.findall(r"^(.+?): \S", done.stdout, re.MULTILINE)
    assert [name for name in mended if name in found] == lacking
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", found["Python"][1])


def test_doctor_names_a_directory_that_takes_no_recording() -> None:
    done = within("doctor", "--record", "/proc")
    found = {row[0]: row[1:] for row in rows(done.stdout)}
    assert found["disk writes"][0] == "lacks"
    assert "\ndisk writes: choose a directory you can write\n" in done.stdout
    assert done.returncode == 1


def test_the_label_sets_are_listed_and_every_label_of_one_with_what_it_means() -> None:
    sets = {row[0]: row[1:] for row in rows(within("labels").stdout)}
    assert sets["gnss_743a"][0] == "00B"
    listed = {row[0]: row[1:] for row in rows(within("labels", "--set", "gnss_743a").stdout) if row[0]}
    assert len(listed) - 1 == int(sets["gnss_743a"][1])  # its heading apart
    assert listed["110"][:6] == ["GNSS latitude", "bnr", "9-29", "180", "0.000171661377", "deg"]
    assert listed["130"][2] == "12-28, satellite_failure 11"
    assert listed["110"][7] == "200 to 1200"


def test_a_set_that_there_is_not_is_named_with_those_there_are() -> None:
    done = within("labels", "--set", "gnss_744")
    assert done.returncode == 1
    assert "'gnss_744'" in done.stderr
    assert "gnss_743a" in done.stderr


def test_the_discrete_bits_of_a_word_are_explained_beside_its_value() -> None:
    word = word429(0o130, {11: (1, 1), 12: (2**13, 17)}, ssm=3)
    found = {row[0]: row[1:] for row in rows(within("decode", "429", f"{word:08x}", "--set", "gnss_743a").stdout)}
    assert found["satellite_failure"] == ["11", "1", "1"]
    assert found["value"] == ["12-28", "1 NM", "NORMAL"]
    damaged = rows(within("decode", "429", f"{word ^ 1 << 31:08x}", "--set", "gnss_743a").stdout)
    assert {row[0]: row[3] for row in damaged}["satellite_failure"] == "not to be trusted"


@pytest.mark.parametrize(("ssm", "sign", "value"), [(0, "plus", "20.5 ft"), (3, "minus", "-20.5 ft")])
def test_the_matrix_of_a_decimal_word_is_its_sign(ssm: int, sign: str, value: str) -> None:
    word = word429(0o165, {11: (0x0205, 19)}, ssm)
    found = {row[0]: row[1:] for row in rows(within("decode", "429", f"{word:08x}", "--set", "ra_707").stdout)}
    assert found["SSM"][2] == f"NORMAL, {sign}"
    assert found["value"][1] == value
