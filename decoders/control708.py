"""What the control panel tells the radar: control words of ARINC 429, labels 270, 271 and 273, read as one command.

Where the bits lie is said by the label set ("wxr_panel" and its variants), whose fields are taken by name, so a panel
that uses other labels or bits needs a set of its own and no code. The codes are those of the radar's own header, which
echoes them. Words that are not normal must be left out before.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from decoders import formats as f
from decoders.arinc708 import GAIN_DB, RANGE_NM
from decoders.definitions import Definition

PANEL: Final = 0x00  # low byte of the equipment id of the panel's label sets
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
    "gain": ("gain_db", lambda code: float(GAIN_DB[code])),
    "range": ("range_nm", lambda code: float(RANGE_NM[code])),
    "vertical_profile": ("vertical_profile", bool),
}


def decode(word: int, definition: Definition, before: Command | None = None) -> Command:
    """The command once `word`, bit 1 the least significant, is heard: what it says, and else what was said before."""
    codes = {name: word >> first - 1 & (1 << last - first + 1) - 1 for name, (first, last) in definition.fields.items()}
    said: dict[str, Any] = {field: read(codes[name]) for name, (field, read) in READ.items() if name in codes}
    if "range_nm" in said and codes.get("divide_range_by_20"):
        said["range_nm"] /= DIVISOR
    return (before or Command())._replace(**said)
