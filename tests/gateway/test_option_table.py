"""The page of the monitor's options says what the monitor checks."""

import re
from pathlib import Path

from gateway.option_table import page
from monitor.settings import LeverArm, MonitorSettings

PAGE = Path(__file__).parents[2] / "docs" / "options.md"


def test_the_page_of_options_is_as_it_was_written() -> None:
    assert PAGE.read_text() == page()


def test_every_option_has_a_default_bounds_and_a_sentence() -> None:
    rows = [row.strip("|\n").split(" | ") for row in page().splitlines() if row.startswith("| `")]
    names = {re.sub(r"\W*(\w[\w.]*)\W*", r"\1", row[0]) for row in rows}
    plain = MonitorSettings.model_fields.keys() - {"lever_arm"}
    assert names == plain | {f"lever_arm.{name}" for name in LeverArm.model_fields}
    assert all(len(row) == 4 and all(cell.strip() for cell in row) for row in rows)
