"""A row of an ARINC 429 definition file: what one label means, read and checked by itself and against its set."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, NamedTuple

from decoders.formats import SSM_TABLES

EXACT: Final = 2**53  # integers up to here are exact as floats, so that a value is rounded once at most


class Encoding(NamedTuple):
    """What an encoding asks of a row: keys it must have, default SSM table and bits, and fixed units."""

    needs: frozenset[str]
    ssm: str
    bits: tuple[int, int] = (11, 29)
    units: str = ""


ENCODINGS: Final = {
    "bnr": Encoding(frozenset({"bits", "range", "lsb", "units"}), "bnr"),
    "bnr_unsigned": Encoding(frozenset({"bits", "range", "lsb", "units"}), "bnr"),
    "bcd": Encoding(frozenset({"bits", "lsb", "units"}), "bcd"),
    "disc": Encoding(frozenset(), "disc"),
    "time": Encoding(frozenset(), "bnr", (12, 28), "s"),
    "date": Encoding(frozenset(), "bcd", units="days since 2000-01-01"),
    "clock": Encoding(frozenset(), "bcd", (11, 28), "min"),
    "iso5": Encoding(frozenset({"bits"}), "disc", units="text"),
}
NUMBER: Final = (int, Fraction, str)
TYPES: Final[dict[str, Any]] = {
    **dict.fromkeys(("label", "name", "encoding", "units", "ssm", "source", "confidence", "positive", "fine_of"), str),
    **dict.fromkeys(("range", "lsb"), NUMBER),
    "bits": (int, list),
    "fields": dict,
    "interval_ms": (int, Fraction, list),
}
WANTED: Final = {key: "text" if kind is str else "table" if kind is dict else "number" for key, kind in TYPES.items()}
LSB_OF_CLOCK: Final = Fraction(1, 10)
CHARACTER_BITS: Final = 7  # of ISO alphabet 5
# Fine label -> coarse label of the words that are joined to a position, by low byte of the equipment's id.
POSITIONS: Final = {0x0B: {0o120: 0o110, 0o121: 0o111}, 0x38: {0o256: 0o254, 0o257: 0o255}}
COARSE: Final = ("bnr", (9, 28), Fraction(180), "deg", None)
FINE: Final = ("bnr_unsigned", (18, 28), Fraction(180, 2**20), "deg")
ROW_NEEDS: Final = frozenset({"label", "name", "encoding", "source", "confidence"})
ROW_MAY_HAVE: Final = frozenset({"ssm", "fields", "fine_of", "positive", "interval_ms"})


class DefinitionError(ValueError):
    """A definition file contradicts itself or the standard; read, the message names file, line, set and label."""


@dataclass(frozen=True, slots=True)
class Definition:
    """One label. `bits` are the first and last of the value, without the sign bit (29) of a "bnr" row.

    `value = integer * lsb`, in `units`, exactly; an "iso5" row is text, 7 bits a character, the first one lowest.
    `fields` are the discrete bits beside or, in a "disc" row, inside the
    value: name -> first and last bit. `ssm` names a row of `decoders.formats.SSM_TABLES`.
    """

    label: int
    name: str
    encoding: str
    bits: tuple[int, int]
    lsb: Fraction
    range: Fraction | None
    units: str
    ssm: str
    fields: Mapping[str, tuple[int, int]]
    source: str
    confidence: str
    positive: str = ""  # the sense of a positive value: "north", "nose up"
    fine_of: int | None = None  # the label whose remainder this word is
    interval_ms: tuple[float, float | None] | None = None  # between two words: shortest, and longest if stated

    @property
    def has_sdi(self) -> bool:
        """Whether bits 9-10 are a source/destination identifier; as part of the value or of a field they are data."""
        return min(first for first, _ in (self.bits, *self.fields.values())) > 10


def read_row(row: object) -> Definition:
    """The definition in a row of a TOML file. Raises DefinitionError, which says why, if it is refused."""
    if not isinstance(row, dict):
        raise DefinitionError(f"{row!r} is no row; write {{ label = ..., name = ..., ... }}")
    _check_types(row)
    if missing := ROW_NEEDS - row.keys():
        raise DefinitionError(f"a row needs {', '.join(sorted(missing))}")
    if row["encoding"] not in ENCODINGS:
        raise DefinitionError(f"unknown encoding {row['encoding']!r}, use one of {', '.join(ENCODINGS)}")
    encoding = ENCODINGS[row["encoding"]]
    _check_keys(row, encoding)
    try:
        definition = Definition(
            label=_label(row["label"]),
            name=row["name"],
            encoding=row["encoding"],
            bits=_bits(row["bits"]) if "bits" in row else encoding.bits,
            lsb=_exact("lsb", row.get("lsb", LSB_OF_CLOCK if row["encoding"] == "clock" else 1)),
            range=_exact("range", row["range"]) if "range" in row else None,
            units=row.get("units", encoding.units),
            ssm=row.get("ssm", encoding.ssm),
            fields={name: _bits(bits) for name, bits in row.get("fields", {}).items()},
            source=row["source"],
            confidence=row["confidence"],
            positive=row.get("positive", ""),
            fine_of=_label(row["fine_of"]) if "fine_of" in row else None,
            interval_ms=_interval(row["interval_ms"]) if "interval_ms" in row else None,
        )
    except ValueError as error:
        raise DefinitionError(str(error)) from error
    _check(definition)
    return definition


def _label(text: str) -> int:
    if not re.fullmatch("[0-3]?[0-7]{1,2}", text):
        raise ValueError(f"{text!r} is no label: write it in octal, '000' to '377'")
    return int(text, 8)


def _bits(bits: int | list[int]) -> tuple[int, int]:
    first, last = (bits, bits) if isinstance(bits, int) else bits
    if not 9 <= first <= last <= 29:
        raise ValueError(f"bits {first} to {last} are not data bits, which are 9 to 29 in rising order")
    return first, last


def _interval(interval: float | Fraction | list[float | Fraction]) -> tuple[float, float | None]:
    shortest, *longest = map(float, interval if isinstance(interval, list) else [interval])
    if shortest < 0 or any(time <= shortest for time in longest):
        raise ValueError(f"interval_ms is {interval}: the longest is above the shortest, which is not negative")
    return shortest, longest[0] if longest else None


def _exact(key: str, number: int | str | Fraction) -> Fraction:
    """An exact number from 0.125 or from text such as "180/2^20"."""
    if not isinstance(number, str):
        return Fraction(number)
    numerator, _, power = number.partition("/2^")
    try:
        return Fraction(numerator) / Fraction(2) ** int(power or 0)
    except (ValueError, ZeroDivisionError) as error:
        raise ValueError(f"{key} is {number!r}: write a number, such as 0.125 or '180/2^20'") from error


def _check_types(row: dict[str, Any]) -> None:
    for key, value in row.items():
        if not isinstance(value, TYPES.get(key, object)) or isinstance(value, bool):
            raise DefinitionError(f"{key} is {value!r}, which is no {WANTED.get(key, 'value')}")
    for key, bits in {"bits": row.get("bits", 9), **row.get("fields", {})}.items():
        ends = [bits] if isinstance(bits, int) else bits
        if not isinstance(ends, list) or not 1 <= len(ends) <= 2 or any(type(end) is not int for end in ends):
            raise DefinitionError(f"{key} is {bits!r}: give a bit, or the first and the last as [11, 28]")
    interval = row.get("interval_ms", 0)
    times = interval if isinstance(interval, list) else [interval]
    if not 1 <= len(times) <= 2 or any(type(time) not in (int, Fraction) for time in times):
        raise DefinitionError(f"interval_ms is {interval!r}: give the shortest, or shortest and longest as [25, 50]")


def _check_keys(row: dict[str, Any], encoding: Encoding) -> None:
    needs = ROW_NEEDS | encoding.needs
    may_have = needs | ROW_MAY_HAVE | ({"bits"} if row["encoding"] == "disc" else frozenset())
    if missing := needs - row.keys():
        raise DefinitionError(f"{row['encoding']} needs {', '.join(sorted(missing))}")
    if unknown := row.keys() - may_have:
        raise DefinitionError(f"unknown for {row['encoding']}: {', '.join(sorted(unknown))}")


def _check(definition: Definition) -> None:
    first, last = definition.bits
    width = last - first + 1
    if definition.ssm not in SSM_TABLES:
        raise DefinitionError(f"unknown ssm {definition.ssm!r}, use one of {', '.join(SSM_TABLES)}")
    if definition.encoding == "iso5" and width % CHARACTER_BITS:
        raise DefinitionError(f"{width} bits do not hold whole characters of {CHARACTER_BITS}")
    if definition.encoding == "bnr" and last != 28:
        raise DefinitionError("bnr bits end at 28, below the sign in bit 29")
    if definition.range is not None and definition.lsb != definition.range / 2**width:
        raise DefinitionError(f"the LSB is not range / 2^{width} = {definition.range / 2**width}")
    if definition.lsb <= 0 or max(definition.lsb.numerator << width, definition.lsb.denominator) > EXACT:
        raise DefinitionError(f"the LSB {definition.lsb} is not positive or too fine to be exact")
    _check_overlap(definition)


def check_fine(fine: Definition, labels: Mapping[int, Definition]) -> None:
    """Refuse, with DefinitionError, a remainder that does not continue the label of its set that it names."""
    if fine.fine_of is None:
        return
    coarse = labels.get(fine.fine_of)
    if coarse is None or fine.encoding != "bnr_unsigned" or (fine.range, fine.units) != (coarse.lsb, coarse.units):
        raise DefinitionError(f"no remainder of label {fine.fine_of:03o}: its range must be that label's LSB, unsigned")


def check_position(row: Definition, equipment_id: int) -> None:
    """Refuse, with DefinitionError, half a position that would be joined from other bits than it is defined by."""
    coarse_of = POSITIONS.get(equipment_id & 0xFF, {})
    found = (row.encoding, row.bits, row.range, row.units, row.fine_of)
    if row.label in coarse_of.values() and found != COARSE:
        raise DefinitionError("a position is joined from bits 9 to 28 of +-180 degrees: define it as bnr of that range")
    coarse = coarse_of.get(row.label)
    if coarse is not None and found != (*FINE, coarse):
        raise DefinitionError(
            "a position is joined from bits 18 to 28 of its fine word: "
            f"define it as bnr_unsigned, fine_of {coarse:03o}, range '180/2^20' deg"
        )


def _check_overlap(definition: Definition) -> None:
    taken = {} if definition.encoding == "disc" else dict.fromkeys(_span(definition.bits), "the value")
    if definition.encoding == "bnr":
        taken[29] = "the sign"
    for name, bits in definition.fields.items():
        for bit in _span(bits):
            if bit in taken:
                raise DefinitionError(f"bit {bit} of {name} overlaps {taken[bit]}")
            taken[bit] = name


def _span(bits: tuple[int, int]) -> range:
    return range(bits[0], bits[1] + 1)
