"""The golden words that reviewers read decode as the page says, and its definition file is one."""

import re
from fractions import Fraction
from pathlib import Path

import pytest

from decoders.arinc429 import Status, decode
from decoders.definitions import load_definitions

PAGE = (Path(__file__).parents[2] / "docs" / "arinc429.md").read_text("utf-8")
ROWS = re.findall(r"^\| `(\w{8})` \| (\w+) \| (\d{3}) \| (.+?) \| (\w+) \|$", PAGE, re.MULTILINE)


def number(text: str) -> Fraction:
    """The exact number at the beginning of a cell: "-45 deg", "3 / 2^2 s", "258494 * 180 / 2^20 deg"."""
    factors = re.match(r"(-?[\d.]+)(?: \* (\d+))?(?: / (\d+)(?:\^(\d+))?)?", text)
    assert factors is not None
    first, times, over, power = factors.groups()
    return Fraction(first) * int(times or 1) / Fraction(over or 1) ** int(power or 1)


@pytest.mark.parametrize(("word", "name", "label", "value", "status"), ROWS, ids=[f"{row[1]}-{row[2]}" for row in ROWS])
def test_a_golden_word_decodes_as_the_page_says(word: str, name: str, label: str, value: str, status: str) -> None:
    definitions = load_definitions(name)
    values = decode([int(word, 16)], definitions)
    row = definitions.labels[int(label, 8)]
    assert (values.label[0], Status(values.status[0]).name) == (row.label, status)
    assert values.value[0] == float(number(value))
    assert value.endswith(f" {row.units}")


def test_every_row_of_the_table_was_read() -> None:
    table = PAGE.split("## Golden words")[1].split("##")[0]
    assert len(ROWS) == table.count("\n|") - 2 > 10


def test_the_definition_file_of_the_page_is_read(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.+?)```", PAGE, re.DOTALL)
    (tmp_path / "mine.toml").write_text(text)
    assert load_definitions(tmp_path / "mine.toml").labels[0o314].bits == (11, 28)
