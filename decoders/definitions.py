"""ARINC 429 label definitions: what the bits of a label mean on one kind of equipment, read from TOML and checked.

A label means different things on different equipment, so definitions come in named sets that a bus port chooses.
Nothing here packs or unpacks a word: decoders and simulators read the same rows and share no more than them.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from decoders.definition_rows import Definition, DefinitionError, check_fine, check_position, read_row
from decoders.toml_places import place

__all__ = [
    "Definition",
    "DefinitionError",
    "Definitions",
    "for_equipment",
    "load_definitions",
    "parse_definitions",
    "set_names",
]

LABELS_FILE: Final = Path(__file__).with_name("labels.toml")

# The set for an equipment that a bridge announces by the low byte of its id.
SET_OF_EQUIPMENT: Final = {
    0x04: "iru_704",
    0x05: "ahrs_705",
    0x06: "adc_706",
    0x07: "ra_707",
    0x0B: "gnss_743a",
    0x31: "clock_731",
    0x38: "adiru_738",
}
SET_KEYS: Final = frozenset({"equipment_id", "extends", "rows"})


@dataclass(frozen=True, eq=False, slots=True)
class Definitions:
    """One set: `labels` maps the conventional label (0o310) to its definition."""

    name: str
    equipment_id: int
    labels: Mapping[int, Definition]


@cache
def load_definitions(name_or_path: str | Path) -> Definitions:
    """The named set of `labels.toml` ("gnss_743a", "iru_704", ...), or the one set of a TOML file of the same form.

    A set that `extends` a named one has its labels too, except those it defines itself. A set is read once a process.

    Raises DefinitionError if a row is refused, ValueError for an unknown name, OSError if a file cannot be read.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        return _named(str(name_or_path))
    return parse_definitions(_text(path), path)


def parse_definitions(text: str, path: Path) -> Definitions:
    """The one set of a TOML text; `path` names it in errors. Raises DefinitionError if a row is refused."""
    file = _file(text, path)
    if len(file.tables) != 1:
        raise DefinitionError(f"{path} has {len(file.tables)} sets: put exactly one in a definition file")
    return _set(file, next(iter(file.tables)))


def set_names() -> tuple[str, ...]:
    """The names of the built-in sets."""
    return tuple(_built_in().tables)


def for_equipment(equipment_id_low_byte: int) -> str | None:
    """The set for the low byte of an equipment id (0x0B -> "gnss_743a"); None for one that has no set."""
    return SET_OF_EQUIPMENT.get(equipment_id_low_byte)


class _File(NamedTuple):
    """A definition file: its tables, and its text for the line of a row."""

    path: Path
    tables: dict[str, Any]
    text: str

    def refusal(self, why: object, name: str, *keys: str | int, label: object = None) -> DefinitionError:
        """An error that begins with the file and line of what is at `keys` of a set, the set and the label, if any."""
        about = f"[{name}]" if label is None else f"[{name}] label {label}"
        return DefinitionError(f"{place(self.path, self.text, name, *keys)} {about}: {why}")


@cache
def _built_in() -> _File:
    file = _file(_text(LABELS_FILE), LABELS_FILE)
    defined: dict[tuple[int, str], str] = {}
    for name, table in file.tables.items():
        for k, row in enumerate([] if "extends" in table else table["rows"]):
            other = defined.setdefault((table["equipment_id"], row["label"]), name)
            if other != name:
                why = f"set {other} defines it for the same equipment: extend that set"
                raise file.refusal(why, name, "rows", k, label=row["label"])
    return file


def _named(name: str) -> Definitions:
    file = _built_in()
    if name not in file.tables:
        raise ValueError(f"no definitions {name!r}: name one of {', '.join(file.tables)} or a .toml file")
    return _set(file, name)


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise DefinitionError(f"{path} is no TOML: {error}") from error


def _file(text: str, path: Path) -> _File:
    try:
        return _File(path, tomllib.loads(text, parse_float=_exact), text)
    except ValueError as error:
        raise DefinitionError(f"{path} is no TOML: {error}") from error


def _exact(number: str) -> Fraction | float:
    """Decimal fractions are kept exact: 0.1 and 4.096 have no exact float. nan and inf are refused with their row."""
    return Fraction(number) if math.isfinite(float(number)) else float(number)


def _set(file: _File, name: str) -> Definitions:
    table = file.tables[name]
    if not isinstance(table, dict) or not {"equipment_id", "rows"} <= table.keys() <= SET_KEYS:
        raise file.refusal("a set has equipment_id, rows and perhaps extends, nothing else", name)
    equipment_id, base = table["equipment_id"], table.get("extends")
    if type(equipment_id) is not int or not 0 <= equipment_id <= 0xFFF:
        raise file.refusal("equipment_id is a number from 0x000 to 0xFFF, as label 377 has it", name, "equipment_id")
    if not isinstance(table["rows"], list):
        raise file.refusal("rows is a list of { label = ..., name = ..., ... }", name, "rows")
    if base is not None and base not in set_names():
        raise file.refusal(f"extends is {base!r}: name one of {', '.join(set_names())}", name, "extends")
    labels: dict[int, Definition] = {}
    rows: dict[int | None, tuple[str, int]] = {}  # by label, where it is defined
    for k, row in enumerate(table["rows"]):
        label = row.get("label", "?") if isinstance(row, dict) else "?"
        try:
            definition = read_row(row)
        except DefinitionError as error:
            raise file.refusal(error, name, "rows", k, label=label) from error
        if definition.label in labels:
            raise file.refusal("defined twice", name, "rows", k, label=label)
        labels[definition.label], rows[definition.label] = definition, ("rows", k)
    whole = {**(_named(base).labels if base is not None else {}), **labels}
    if not whole:
        raise file.refusal("a set has at least one row", name, "rows")
    for label, definition in whole.items():
        try:
            check_position(definition, equipment_id)
            check_fine(definition, whole)
        except DefinitionError as error:  # of a row of the file, or of an inherited one that is no remainder any more
            keys = rows.get(label) or rows.get(definition.fine_of) or ()
            raise file.refusal(error, name, *keys, label=f"{label:03o}") from error
    return Definitions(name, equipment_id, whole)
