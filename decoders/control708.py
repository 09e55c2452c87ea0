"""What the control panel tells the radar: control words of ARINC 429, labels 270, 271 and 273, read as one command.

Where the bits lie is said by the label set ("wxr_panel" and its variants), whose fields are taken by name, so a panel
that uses other labels or bits needs a set of its own and no code. The codes are those of the radar's own header, which
echoes them. Words that are not normal must be left out before.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from decoders import formats as f
from decoders import kernels708
from decoders.definitions import Definition, DefinitionError, Definitions

WIDTHS: Final = {"mode": 3, "tilt": 7, "gain": 6, "range": 6}  # as in the radar's header; all else is one bit
DIVISOR: Final = 20


class Command(NamedTuple):
    """What the panel asks for; None for what it has not said yet."""

    sector_scan: bool | None = None
    anti_clutter: bool | None = None  # of control word 1
    anti_clutter_2: bool | None = None  # of control word 2
    stabilised: bool | None = None
    mode: int | None = None  # code, as in the header
    tilt_deg: float | None = None  # up positive
    gain_db: float | None = None  # 0 maximum, nan calibrated, else negative
    range_nm: float | None = None
    vertical_profile: bool | None = None


def _tilt_deg(code: int) -> float:
    return (code - (code >> 6 << 7)) * f.TILT_LSB_DEG


READ: Final[dict[str, tuple[str, Callable[[int], float]]]] = {
    "sector_scan": ("sector_scan", bool),
    "anti_clutter": ("anti_clutter", bool),
    "anti_clutter_2": ("anti_clutter_2", bool),
    "stabilised": ("stabilised", bool),
    "mode": ("mode", int),
    "tilt": ("tilt_deg", _tilt_deg),
    "gain": ("gain_db", kernels708.gain_db),
    "range": ("range_nm", kernels708.range_nm),
    "vertical_profile": ("vertical_profile", bool),
}


def is_panel(definitions: Definitions) -> bool:
    """Whether a label set is that of a control panel: one of its words asks for a mode and a tilt.

    Raises DefinitionError for fields of another width than the radar's header has.
    """
    panel = any({"mode", "tilt"} <= row.fields.keys() for row in definitions.labels.values())
    for row in definitions.labels.values() if panel else ():
        for name in READ.keys() & row.fields.keys():
            first, last = row.fields[name]
            if last - first + 1 != WIDTHS.get(name, 1):
                raise DefinitionError(
                    f"[{definitions.name}] label {row.label:03o}: {name} has {last - first + 1} bits, "
                    f"the radar's header {WIDTHS.get(name, 1)}"
                )
    return panel


def decode(word: int, definition: Definition, before: Command | None = None) -> Command:
    """The command once `word`, bit 1 the least significant, is heard: what it says, and else what was said before."""
    codes = {name: word >> first - 1 & (1 << last - first + 1) - 1 for name, (first, last) in definition.fields.items()}
    said: dict[str, Any] = {field: read(codes[name]) for name, (field, read) in READ.items() if name in codes}
    if "range_nm" in said and codes.get("divide_range_by_20"):
        said["range_nm"] /= DIVISOR
    return (before or Command())._replace(**said)
