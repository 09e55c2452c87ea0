"""ARINC 429 label definitions: what the bits of a label mean on one kind of equipment, read from TOML and checked.

A label means different things on different equipment, so definitions come in named sets that a bus port chooses.
Nothing here packs or unpacks a word: decoders and simulators read the same rows and share no more than them.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from decoders.definition_rows import Definition, DefinitionError, check_fine, read_row

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
COMMENT_OR_TEXT: Final = re.compile(r"""'[^']*'|"(?:[^"\\]|\\.)*"|#.*""")
HEADER: Final = re.compile(r"\[\[?([\w.-]+)\]\]?")
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

    def where(self, name: str, label: object, row: int) -> str:
        """File and line of a set's row, counted from 0, as editors take it, its set and its label."""
        lines = _row_lines(self.text, name)
        line = f":{lines[row]}" if row < len(lines) else ""
        return f"{self.path}{line} [{name}] label {label}"


def _row_lines(text: str, name: str) -> list[int]:
    """The lines on which the rows of a set begin: its inline tables, or its headers [[name.rows]]."""
    lines, inside, depth = [], False, 0
    for number, line in enumerate(text.splitlines(), 1):
        bare = COMMENT_OR_TEXT.sub("", line)
        header = HEADER.fullmatch(bare.strip()) if not depth else None
        if header:
            inside = header[1] == name
            if header[1] == f"{name}.rows":
                lines.append(number)
        for mark in bare if inside and not header else "":
            lines += [number] if mark == "{" and depth == 1 else []
            depth += (mark in "[{") - (mark in "]}")
    return lines


@cache
def _built_in() -> _File:
    file = _file(_text(LABELS_FILE), LABELS_FILE)
    defined: dict[tuple[int, str], str] = {}
    for name, table in file.tables.items():
        for k, row in enumerate([] if "extends" in table else table["rows"]):
            other = defined.setdefault((table["equipment_id"], row["label"]), name)
            if other != name:
                where = file.where(name, row["label"], k)
                raise DefinitionError(f"{where}: set {other} defines it for the same equipment: extend that set")
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
    # Decimal fractions are kept exact: 0.1 and 4.096 have no exact float.
    try:
        return _File(path, tomllib.loads(text, parse_float=Fraction), text)
    except ValueError as error:  # no TOML, or a number that is none
        raise DefinitionError(f"{path} is no TOML: {error}") from error


def _set(file: _File, name: str) -> Definitions:
    table = file.tables[name]
    if not isinstance(table, dict) or not {"equipment_id", "rows"} <= table.keys() <= SET_KEYS:
        raise DefinitionError(f"{file.path} [{name}]: a set has equipment_id, rows and perhaps extends, nothing else")
    if type(table["equipment_id"]) is not int or not 0 <= table["equipment_id"] <= 0xFFF:
        raise DefinitionError(
            f"{file.path} [{name}]: equipment_id is a number from 0x000 to 0xFFF, as label 377 has it"
        )
    if not isinstance(table["rows"], list):
        raise DefinitionError(f"{file.path} [{name}]: rows is a list of {{ label = ..., name = ..., ... }}")
    labels: dict[int, Definition] = {}
    for k, row in enumerate(table["rows"]):
        if not isinstance(row, dict):
            raise DefinitionError(f"{file.path} [{name}]: {row!r} is no row; write {{ label = ..., name = ..., ... }}")
        where = file.where(name, row.get("label", "?"), k)
        definition = read_row(where, row)
        if definition.label in labels:
            raise DefinitionError(f"{where}: defined twice")
        labels[definition.label] = definition
    try:
        inherited = _named(table["extends"]).labels if "extends" in table else {}
    except ValueError as error:
        raise DefinitionError(f"{file.path} [{name}] extends: {error}") from error
    if not inherited and not labels:
        raise DefinitionError(f"{file.path} [{name}]: a set has at least one row")
    whole = {**inherited, **labels}
    for definition in whole.values():
        check_fine(f"{file.path} [{name}] label {definition.label:03o}", definition, whole)
    return Definitions(name, table["equipment_id"], whole)
