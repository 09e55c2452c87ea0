"""Every row of the published label table is in a set, with the range and the LSB that the table states."""

import csv
import re
from fractions import Fraction
from pathlib import Path

import pytest

from decoders.definitions import SET_OF_EQUIPMENT, Definition, load_definitions, set_names

TABLE = Path(__file__).parents[1] / "data" / "arinc429_labels.csv"
SETS_OF = {f"{equipment:03X}": name for equipment, name in SET_OF_EQUIPMENT.items()}
SETS_OF |= {"WXR panel": "wxr_panel", "WXR/EFIS": "wxr_panel", "any": "gnss_743a"}
# Rows whose text names several boxes; the variants have sets of their own.
VARIANT_SETS = {
    "004": ("iru_704", "iru_704_12bit", "iru_704_18bit", "iru_704_20bit"),
    "006": ("adc_706", "adc_706_18bit"),
    "00B": ("gnss_743a", "gnss_743"),
}
ROWS = list(csv.DictReader(TABLE.read_text("utf-8").splitlines()))


def sets_of(row: dict[str, str]) -> list[str]:
    """The sets of every equipment that a row names."""
    names = [row["eq_id"]] if row["eq_id"] in SETS_OF else row["eq_id"].split("/")
    return [SETS_OF[name.rjust(3, "0")] if name not in SETS_OF else SETS_OF[name] for name in names]


def number(text: str) -> Fraction | None:
    """The one exact number of a cell such as "180/2^20=0.00017" or "2^-30=9.3e-10", or None."""
    exact = text.replace("±", "").replace("NM", "").partition("=")[0].partition(" (")[0].strip()
    power = re.fullmatch(r"([\d.]*)/?2\^(-?\d+)", exact)
    if power:
        exponent = int(power[2])
        return Fraction(power[1] or 1) * Fraction(2) ** (-exponent if "/" in exact else exponent)
    return Fraction(exact) if re.fullmatch(r"[\d.]+", exact) else None


def row_id(row: dict[str, str]) -> str:
    return f"{row['label']}-{row['eq_id'].replace('/', '+').replace(' ', '_')}"


def definitions_of(row: dict[str, str]) -> list[Definition]:
    return [load_definitions(name).labels[int(row["label"], 8)] for name in sets_of(row)]


@pytest.mark.parametrize("row", ROWS, ids=row_id)
def test_every_row_is_defined_for_its_equipment(row: dict[str, str]) -> None:
    for definition in definitions_of(row):
        assert definition.source
        assert definition.confidence


@pytest.mark.parametrize("row", [row for row in ROWS if number(row["lsb"])], ids=row_id)
def test_the_lsb_is_the_tables(row: dict[str, str]) -> None:
    stated = number(row["lsb"])
    assert stated is not None
    for definition in definitions_of(row):
        if definition.encoding in ("bnr", "bnr_unsigned", "bcd"):
            # Decimal cells are rounded (0.0055) or cut (0.015): they name the binary LSB to their last digit.
            digits = len(row["lsb"].partition(".")[2].partition(" ")[0])
            assert abs(definition.lsb - stated) < Fraction(1, 10 ** min(digits, 9)) or definition.lsb == stated


@pytest.mark.parametrize("row", [row for row in ROWS if number(row["range"])], ids=row_id)
def test_the_range_is_the_tables(row: dict[str, str]) -> None:
    for definition in definitions_of(row):
        if definition.encoding in ("bnr", "bnr_unsigned") and definition.fine_of is None:
            assert definition.range == number(row["range"])


@pytest.mark.parametrize(
    ("label", "bits"),
    [
        (0o312, {15, 18, 20}),
        (0o313, {12, 15, 18, 20}),
        (0o314, {15, 18, 20}),
        (0o315, {8, 18, 20}),
        (0o324, {14, 18, 20}),
        (0o325, {14, 18, 20}),
        (0o326, {13, 15, 18}),
        (0o331, {12, 15, 18}),
        (0o365, {15, 18, 20}),
    ],
)
def test_an_inertial_label_comes_in_every_width_that_boxes_have(label: int, bits: set[int]) -> None:
    found = {load_definitions(name).labels[label].bits for name in VARIANT_SETS["004"]}
    assert {last - first + 1 for first, last in found} == bits


def test_the_figures_of_merit_are_metres_in_743_and_feet_or_miles_in_743a() -> None:
    units = [[load_definitions(name).labels[label].units for label in (0o136, 0o247)] for name in VARIANT_SETS["00B"]]
    assert units == [["ft", "NM"], ["m", "m"]]


def test_a_fine_word_begins_where_its_coarse_word_ends() -> None:
    found = 0
    for name in set_names():
        labels = load_definitions(name).labels
        for fine in labels.values():
            if fine.fine_of is not None:
                assert fine.range == labels[fine.fine_of].lsb
                found += 1
    assert found >= 11
