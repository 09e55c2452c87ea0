"""Words that others have published with their values, each decoded by a definition written for it."""

import json
from datetime import date
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from decoders.arinc429 import Status, decode, unpack
from decoders.definitions import load_definitions

FILE = Path(__file__).parents[1] / "data" / "arinc429_words.jsonl"
ROWS = [json.loads(line) for line in FILE.read_text("utf-8").splitlines()]
NUMBERS = [row for row in ROWS if row["encoding"] in ("BNR", "BNR_UNSIGNED", "BCD", "DISC")]
DATES = [row for row in ROWS if row["encoding"] == "DATE260"]
NORMAL_SSM = {"BNR": 3, "BNR_UNSIGNED": 3, "BCD": 0, "DISC": 0}
STATUSES = {
    "BNR": [Status.FAILURE_WARNING, Status.NO_COMPUTED_DATA, Status.FUNCTIONAL_TEST, Status.NORMAL],
    "BCD": [Status.NORMAL, Status.NO_COMPUTED_DATA, Status.FUNCTIONAL_TEST, Status.NORMAL],
    "DISC": [Status.NORMAL, Status.NO_COMPUTED_DATA, Status.FUNCTIONAL_TEST, Status.FAILURE_WARNING],
}


def orientation(row: dict[str, Any]) -> Any:
    return "label_swapped" if "NOT reversed" in row["bit_order"] else "wire"


def with_ssm(word: int, ssm: int) -> int:
    """The same word under another SSM, with its parity mended."""
    word = word & ~(0b111 << 29) | ssm << 29
    return word | (word.bit_count() + 1) % 2 << 31


def definition_file(folder: Path, row: dict[str, Any]) -> Path:
    """A set of one label whose value is the row's field. The sign of a BNR is bit 29, above its bits."""
    first, last = row["field_lsb"], row["field_msb"] - (row["encoding"] == "BNR")
    lsb = Decimal(str(row["resolution"]))
    scale = "" if row["encoding"] == "DISC" else f", lsb = {lsb}, units = '{row['units']}'"
    if row["encoding"].startswith("BNR"):
        scale += f", range = {lsb * 2 ** (last - first + 1)}"
    file = folder / "published.toml"
    file.write_text(
        "[published]\nequipment_id = 0\nrows = [{ name = 'published', source = 'published', confidence = '1 source',"
        f" label = '{row['label_octal']}', encoding = '{row['encoding'].lower()}', bits = [{first}, {last}]{scale} }}]",
        "utf-8",
    )
    return file


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["word_hex"])
def test_a_published_word_has_its_published_parts(row: dict[str, Any]) -> None:
    parts = unpack([int(row["word_hex"], 16)], orientation(row))
    assert parts.label[0] == int(row["label_octal"], 8)
    assert (parts.sdi[0], parts.ssm[0], parts.parity_ok[0]) == (row["sdi"], row["ssm"], row["parity_odd_ok"])


@pytest.mark.parametrize("row", NUMBERS, ids=lambda row: row["word_hex"])
def test_a_published_number_has_its_published_value(row: dict[str, Any], tmp_path: Path) -> None:
    word = with_ssm(int(row["word_hex"], 16), NORMAL_SSM[row["encoding"]])
    values = decode([word], load_definitions(definition_file(tmp_path, row)), orientation(row))
    assert values.status[0] == Status.NORMAL
    assert values.value[0] == row["value"]


@pytest.mark.parametrize("row", NUMBERS, ids=lambda row: row["word_hex"])
def test_a_published_number_has_the_status_its_own_ssm_gives(row: dict[str, Any], tmp_path: Path) -> None:
    word = int(row["word_hex"], 16)
    values = decode([word], load_definitions(definition_file(tmp_path, row)), orientation(row))
    status = STATUSES[row["encoding"].split("_")[0]][row["ssm"]]
    sign = -1 if row["encoding"] == "BCD" and row["ssm"] == 3 else 1
    assert values.status[0] == status
    assert values.value[0] == (sign * row["value"] if status == Status.NORMAL else 0.0)


@pytest.mark.parametrize("row", DATES, ids=lambda row: row["word_hex"])
def test_a_published_date_is_that_day(row: dict[str, Any]) -> None:
    day, month, year = (int(part) for part in row["value"].split()[0].split("-"))
    values = decode([int(row["word_hex"], 16)], load_definitions("gnss_743a"), orientation(row))
    assert values.status[0] == Status.NORMAL
    assert values.value[0] == (date(2000 + year, month, day) - date(2000, 1, 1)).days


def test_published_raw_fields_are_bits_11_to_29() -> None:
    rows = [row for row in ROWS if row["encoding"] == "RAW19"]
    assert [unpack([int(row["word_hex"], 16)], orientation(row)).data[0] for row in rows] == [
        row["value"] for row in rows
    ]


def test_a_published_station_ident_is_two_iso_5_characters_eight_bits_apart() -> None:
    row = next(row for row in ROWS if row["encoding"] == "ISO5x2")
    data = int(unpack([int(row["word_hex"], 16)], orientation(row)).data[0])
    assert chr(data & 0x7F) + chr(data >> 8 & 0x7F) == row["value"]
