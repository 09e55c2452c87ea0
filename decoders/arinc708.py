"""ARINC 708 radar words to radials: header fields in engineering units and range bins.

Every word of the right length becomes a radial, whatever its label, range or gain code: nothing is dropped here.
"""

from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from decoders import formats as f
from decoders import kernels708, kernels708_bins
from decoders.profiles import Profile, ProfileError, load_profile
from decoders.results708 import Header, Meanings, Radials

__all__ = ["Header", "Profile", "ProfileError", "Radials", "headers", "load_profile", "misread_bits", "unpack"]

HALF_TURN: Final = 2048  # codes of the scan angle
RESERVED: Final = "reserved"  # the name of a mode or level without a meaning
NO_LEVEL: Final = 255
ENOUGH_LIT: Final = 1000  # codes above zero, of which a scan over land has ten times as many
CLEARLY: Final = 1.1  # noise alone gives 1; radars over land give 1.3 and more, one way or the other


def unpack(words: npt.ArrayLike, profile: str | Profile = "arinc708") -> Radials:
    """The radials of words (n, bytes) u1 as received, bit 0 the least significant of byte 0 (ARINC 708 data word).

    Raises ValueError for words that are no bytes or not of the profile's length (200), and for an unknown profile.
    """
    settings = load_profile(profile) if isinstance(profile, str) else profile
    array = _words(words)
    if array.shape[1] != settings.word_bytes:
        raise ValueError(
            f"words of shape {array.shape}: profile {settings.name} takes (n, {settings.word_bytes}) bytes"
            f" ({settings.word_bits} bits a word)"
        )
    meanings, reserved_levels = _meanings(settings)
    header = _headers(array, meanings)
    bins = np.empty((len(array), settings.bins), np.uint8)
    for level in reserved_levels:
        kernels708_bins.unpack_bins(array, settings.bits_per_bin, level, bins, header.unusual)
    return Radials(*header[:-1], bins, header.unusual)


def headers(words: npt.ArrayLike, profile: str | Profile = "arinc708") -> Header:
    """The header fields of words (n, bytes) u1 of any length from 8 bytes, such as short words and headers alone.

    Raises ValueError for words that are no bytes or shorter, and for an unknown profile.
    """
    settings = load_profile(profile) if isinstance(profile, str) else profile
    return _headers(_words(words), _meanings(settings)[0])


def misread_bits(bins: npt.NDArray[np.uint8]) -> int | None:
    """How many bits a bin seems to have, 3 or 6, if bins (n, M) were unpacked with the other number; else None.

    Neighbours resemble each other. Cut every 3 bits, whole bins differ less from the next than from the one after;
    halves of 6-bit bins differ more, a high half being like the next high half.
    """
    used = 6 if bins.max(initial=0) > 7 else 3
    thirds = bins if used == 3 else np.stack([bins & 7, bins >> 3], axis=-1).reshape(len(bins), -1)
    if np.count_nonzero(thirds) < ENOUGH_LIT:
        return None
    next_one, one_after = kernels708_bins.mean_step(thirds, 1), kernels708_bins.mean_step(thirds, 2)
    if used == 3:
        return 6 if next_one > CLEARLY * one_after else None
    return 3 if one_after > CLEARLY * next_one else None


def _headers(array: npt.NDArray[np.uint8], meanings: Meanings) -> Header:
    header = Header.empty(len(array))
    kernels708.headers(array, meanings, header)
    return header


@cache
def _meanings(settings: Profile) -> tuple[Meanings, list[int]]:
    """What the kernels need of a profile, and the levels to flag, or one that no bin has."""
    meanings = Meanings(
        labels=np.array(settings.labels, np.uint8),
        reserved_modes=_reserved(settings.modes),
        scan_angle_zero=HALF_TURN if settings.scan_angle_zero == "tail" else 0,
        scan_angle_sense=1 if settings.scan_angle_sense == "clockwise" else -1,
    )
    return meanings, _reserved(settings.levels).tolist() or [NO_LEVEL]


def _reserved(names: Sequence[str]) -> npt.NDArray[np.uint8]:
    return np.array([code for code, name in enumerate(names) if name == RESERVED], np.uint8)


def _words(words: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    array = np.asarray(words)
    if array.ndim != 2 or array.shape[1] < f.HEADER_708_BYTES:
        raise ValueError(
            f"words of shape {array.shape}: pass (n, bytes), at least the {f.HEADER_708_BYTES} of a header"
        )
    if array.dtype != np.uint8:
        raise ValueError(f"words of type {array.dtype}: pass bytes, uint8")
    return array if array.flags.carray else array.copy()  # one memory layout, so that the kernels are compiled once
