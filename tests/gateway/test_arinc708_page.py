"""The words that the page gives decode as it says, by the command that it names."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from decoders import formats as f
from decoders.arinc708 import unpack
from decoders.profiles import parse_profile
from gateway.cli import app
from tests.gateway.test_cli_words import rows

PAGE = Path(__file__).parents[2] / "docs" / "arinc708.md"
TEXT = PAGE.read_text(encoding="utf-8")
GOLDEN = [row for row in rows(TEXT) if re.fullmatch("`[0-9a-f]{16}`", row[0])]
HEAD = ("label", "faults", "mode", "tilt", "gain", "range", "scan_angle")


def test_the_page_has_golden_words_and_the_command_that_explains_them() -> None:
    assert len(GOLDEN) == 5
    assert f"`shadebus decode 708 {GOLDEN[0][0].strip('`')}`" in TEXT
    assert ["header", *HEAD, "unusual"] in rows(TEXT)


@pytest.mark.parametrize("row", GOLDEN, ids=lambda row: str(row[0].strip("`")))
def test_a_golden_word_decodes_as_the_page_says(row: list[str]) -> None:
    done = CliRunner().invoke(app, ["decode", "708", row[0].strip("`")])
    assert done.exit_code == 0
    found = {cells[0]: cells for cells in rows(done.output)}
    assert [found[name][3] for name in HEAD] == row[1:-1]
    assert ", ".join(name for name, cells in found.items() if "UNUSUAL" in cells[5]) == row[-1]


def test_the_bits_of_the_page_are_those_of_the_decoder() -> None:
    places = {cells[1]: cells[0] for cells in rows(TEXT) if re.fullmatch(r"\d+(-\d+)?", cells[0])}
    expected = (f.HEADER_708 | f.SPARE_708).items()
    assert places.pop("bins") == "64-1599"
    assert places == {name: f"{a}-{a + n - 1}" if n > 1 else f"{a}" for name, (a, n) in expected}


def test_the_payload_of_the_page_is_the_bins_that_it_names() -> None:
    (payload,) = re.findall("payload `([0-9a-f]+)`", TEXT)
    word = list(bytes(8) + bytes.fromhex(payload) * 64)
    assert unpack(np.array([word], np.uint8)).bins.tolist() == [list(range(8)) * 64]


def test_the_profile_of_the_page_is_one() -> None:
    (block,) = re.findall("```toml\n(.+?)```", TEXT, re.DOTALL)
    profile = parse_profile(block, PAGE)
    assert (profile.scan_angle_zero, profile.scan_angle_sense, profile.bins) == ("tail", "counterclockwise", 512)


def test_the_page_names_everything_unusual() -> None:
    assert all(name in TEXT for name in f.UNUSUAL_708)
