"""Radar profiles: what differs between radars that speak ARINC 708, read from TOML and checked."""

import tomllib
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import ConfigDict, Field, ValidationError, model_validator
from pydantic.dataclasses import dataclass

from decoders.formats import HEADER_708_BYTES, LONGEST_WORD_708_BITS
from decoders.toml_places import place

HEADER_BITS: Final = 8 * HEADER_708_BYTES
PROFILES_FILE: Final = Path(__file__).with_name("profiles.toml")
FEWEST_BINS: Final = 64  # a kernel unpacks so many in one go
BINS_IN_STEPS_OF: Final = 8  # of 3 or 6 bits are whole bytes

Label = Annotated[int, Field(strict=True, ge=0, le=0o377)]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")]


class ProfileError(ValueError):
    """A profile that no radar can have; the message names the file, the line, the profile and the key."""


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid"))
class Profile:
    """Settings of one radar; `profiles.toml` explains them. `dataclasses.replace` makes a variant.

    Raises pydantic's ValidationError, a ValueError, for settings that no word can have.
    """

    name: str
    word_bits: Annotated[int, Field(strict=True, le=LONGEST_WORD_708_BITS)]
    bins: Annotated[int, Field(strict=True, ge=FEWEST_BINS, multiple_of=BINS_IN_STEPS_OF)]
    bits_per_bin: Literal[3, 6]
    labels: Annotated[tuple[Label, ...], Field(min_length=1)]
    scan_angle_zero: Literal["nose", "tail"]
    scan_angle_sense: Literal["clockwise", "counterclockwise"]
    faults: Annotated[tuple[str, ...], Field(min_length=7, max_length=7)]
    modes: Annotated[tuple[str, ...], Field(min_length=8, max_length=8)]
    levels: tuple[str, ...]
    colours: Annotated[tuple[Colour, ...], Field(min_length=2)]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.word_bits != HEADER_BITS + self.bins * self.bits_per_bin:
            raise ValueError(
                f"word_bits is {self.word_bits}, but a header of {HEADER_BITS} bits and"
                f" {self.bins} bins of {self.bits_per_bin} are {HEADER_BITS + self.bins * self.bits_per_bin}"
            )
        if len(self.levels) not in (0, 2**self.bits_per_bin):
            raise ValueError(f"levels: name all {2**self.bits_per_bin} or none, not {len(self.levels)}")
        if len(self.colours) > 2**self.bits_per_bin:
            raise ValueError(f"colours: {len(self.colours)} are more than the {2**self.bits_per_bin} levels")
        return self

    @property
    def word_bytes(self) -> int:
        """Length of a word, header included."""
        return self.word_bits // 8

    @property
    def level_names(self) -> tuple[str, ...]:
        """What each level is called; a level without a public name is called by its number."""
        return self.levels or tuple(f"level {level}" for level in range(2**self.bits_per_bin))

    @property
    def palette(self) -> tuple[str, ...]:
        """The colour of each level as #rrggbb, blended between `colours`, which lie evenly over the levels."""
        last = 2**self.bits_per_bin - 1
        return tuple(_blend(self.colours, level * (len(self.colours) - 1) / last) for level in range(last + 1))


@cache
def load_profile(name_or_path: str | Path) -> Profile:
    """The profile "arinc708", "arinc708a" or "wxr2100_6bit", or the one profile of a TOML file of the same form.

    A profile that `extends` a named one has its settings too, except those it gives itself. It is read once a process.

    Raises ProfileError if it is refused, ValueError for an unknown name, OSError if the file cannot be read.
    """
    path = Path(name_or_path)
    if path.suffix == ".toml":
        return parse_profile(_text(path), path)
    return _named(str(name_or_path))


def parse_profile(text: str, path: Path) -> Profile:
    """The one profile of a TOML text; `path` names it in errors. Raises ProfileError if it is refused."""
    tables = _tables(text, path)
    if len(tables) != 1:
        raise ProfileError(f"{path} has {len(tables)} tables: put exactly one profile in a file")
    ((name, table),) = tables.items()
    return _profile(path, text, name, table)


def _named(name: str) -> Profile:
    text = _text(PROFILES_FILE)
    tables = _tables(text, PROFILES_FILE)
    if name not in tables:
        raise ValueError(f"no profile {name!r}: use one of {', '.join(tables)}, or a .toml file")
    return _profile(PROFILES_FILE, text, name, tables[name])


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise ProfileError(f"{path} is no TOML: {error}") from error


def _tables(text: str, path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ProfileError(f"{path} is no TOML: {error}") from error


def _profile(path: Path, text: str, name: str, table: object) -> Profile:
    def where(*keys: str | int) -> str:
        return " ".join((f"{place(path, text, name, *keys)} [{name}]", *map(str, keys)))

    if not isinstance(table, dict):
        raise ProfileError(f"{where()}: a profile is a table of settings, not {table!r}")
    if "name" in table:
        raise ProfileError(f"{where('name')}: a profile is called what its table is called; leave the key out")
    named = tuple(_tables(_text(PROFILES_FILE), PROFILES_FILE))
    base = table.get("extends")
    if base is not None and base not in named:
        raise ProfileError(f"{where('extends')}: no profile {base!r}: use one of {', '.join(named)}")
    inherited = {} if base is None else asdict(_named(base))
    own = {key: value for key, value in table.items() if key != "extends"}
    try:
        return Profile(**inherited | own | {"name": name})
    except ValidationError as error:
        said = [(problem["loc"], problem["msg"].removeprefix("Value error, ")) for problem in error.errors()]
        # A row that is short of what was refused inside it is no complaint of its own.
        told = [(keys, why) for keys, why in said if not any(keys == other[: len(keys)] != other for other, _ in said)]
        raise ProfileError("; ".join(f"{where(*keys)}: {why}" for keys, why in told)) from error


def _blend(colours: tuple[str, ...], at: float) -> str:
    """The colour `at` steps along a row of colours."""
    first = min(int(at), len(colours) - 2)
    near, far = (bytes.fromhex(colour[1:]) for colour in colours[first : first + 2])
    return "#" + bytes(round(a + (b - a) * (at - first)) for a, b in zip(near, far, strict=True)).hex()
