"""Radar profiles: what differs between radars that speak ARINC 708, read from `profiles.toml`."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from decoders.formats import HEADER_708_BYTES

PROFILES_FILE: Final = Path(__file__).with_name("profiles.toml")
GROUP_BITS: Final = 24  # three payload bytes hold a whole number of bins


@dataclass(frozen=True, slots=True)
class Profile:
    """Settings of one radar; `dataclasses.replace` makes a variant.

    Raises ValueError for settings that no word can have.
    """

    name: str
    bins: int
    bits_per_bin: int  # 3 or 6
    scan_angle_zero: str  # "nose" or "tail"
    faults: tuple[str, ...]  # header bits 18 to 24
    modes: tuple[str, ...]  # codes 0 to 7

    def __post_init__(self) -> None:
        if self.bits_per_bin not in (3, 6) or self.bins * self.bits_per_bin % GROUP_BITS:
            raise ValueError(f"profile {self.name}: bins are 3 or 6 bits, and whole in {GROUP_BITS} bits")
        if self.scan_angle_zero not in ("nose", "tail"):
            raise ValueError(f"profile {self.name}: scan_angle_zero is nose or tail, not {self.scan_angle_zero!r}")
        if (len(self.faults), len(self.modes)) != (7, 8):
            raise ValueError(f"profile {self.name}: name 7 faults and 8 modes")

    @property
    def word_bytes(self) -> int:
        """Length of a word, header included."""
        return HEADER_708_BYTES + self.bins * self.bits_per_bin // 8


def load_profile(name: str) -> Profile:
    """The profile "arinc708", "arinc708a" or "wxr2100_6bit". Raises ValueError for another name."""
    if name not in _profiles():
        raise ValueError(f"no profile {name!r}: use one of {', '.join(_profiles())}")
    return _profiles()[name]


@cache
def _profiles() -> dict[str, Profile]:
    return {name: _profile(name, table) for name, table in tomllib.loads(PROFILES_FILE.read_text("utf-8")).items()}


def _profile(name: str, table: dict[str, Any]) -> Profile:
    return Profile(name, **table | {"faults": tuple(table["faults"]), "modes": tuple(table["modes"])})
