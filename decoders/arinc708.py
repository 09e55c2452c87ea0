"""ARINC 708 radar words to radials: header fields in engineering units and range bins.

Every word of the right length becomes a radial, whatever its label, range or gain code: nothing is dropped here.
"""

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from decoders import formats as f
from decoders import kernels708
from decoders.profiles import Profile, load_profile

__all__ = ["Profile", "Radials", "load_profile", "misread_bits", "unpack"]

HEADER_FIELDS: Final = np.array(list(f.HEADER_708.values()), np.int64)
# The label alone is sent most significant bit first.
REVERSED: Final = np.array([int(f"{byte:08b}"[::-1], 2) for byte in range(256)], np.uint8)
CODES: Final = np.arange(64)
GAIN_DB: Final = np.where(f.GAIN_CALIBRATED == CODES, np.nan, np.abs(CODES) * f.GAIN_LSB_DB + 0.0)
ENOUGH_LIT: Final = 1000  # codes above zero, of which a scan over land has ten times as many
CLEARLY: Final = 1.1  # noise alone gives 1; radars over land give 1.3 and more, one way or the other
RANGE_NM: Final = np.where(CODES == 0, f.RANGE_CODE_ZERO_NM, CODES * float(f.RANGE_LSB_NM))


class Radials(NamedTuple):
    """n radials. ARINC 708 header bits in brackets, bit 0 the first on the wire; all fields but `bins` are (n,)."""

    label: npt.NDArray[np.uint8]  # conventional: 0o055 for a radar [0-7]
    control_accept: npt.NDArray[np.uint8]  # 0 none, 1, 2, 3 both indicators [8-9]
    slave: npt.NDArray[np.bool_]  # [10]
    annunciations: npt.NDArray[np.uint8]  # bit 13 is 1, named in `formats.ANNUNCIATIONS_708` [13-17]
    faults: npt.NDArray[np.uint8]  # bit 18 is 1, named by the profile [18-24]
    stabilised: npt.NDArray[np.bool_]  # [25]
    mode: npt.NDArray[np.uint8]  # code, named by the profile [26-28]
    tilt_deg: npt.NDArray[np.float64]  # -16 to 15.75, up positive [29-35]
    gain_db: npt.NDArray[np.float64]  # 0 maximum, nan calibrated, else negative [36-41]
    range_nm: npt.NDArray[np.float64]  # 5 to 320 [42-47]
    data_accept: npt.NDArray[np.uint8]  # 0 none, 1, 2, 3 any [49-50]
    scan_angle_deg: npt.NDArray[np.float64]  # [-180, 180) from the nose, clockwise positive [51-62]
    bins: npt.NDArray[np.uint8]  # (n, M), nearest first, 3 or 6 bits each


def unpack(words: npt.ArrayLike, profile: str | Profile = "arinc708") -> Radials:
    """The radials of words (n, bytes) u1 as received, bit 0 the least significant of byte 0 (ARINC 708 data word).

    Raises ValueError for words that are no bytes or not of the profile's length (200), and for an unknown profile.
    """
    settings = load_profile(profile) if isinstance(profile, str) else profile
    array = _words(words, settings)
    codes = np.empty((len(f.HEADER_708), array.shape[0]), np.uint16)
    bins = np.empty((array.shape[0], settings.bins), np.uint8)
    kernels708.unpack(array, HEADER_FIELDS, settings.bits_per_bin, codes, bins)
    return _radials(dict(zip(f.HEADER_708, codes, strict=True)), bins, settings)


def misread_bits(bins: npt.NDArray[np.uint8]) -> int | None:
    """How many bits a bin seems to have, 3 or 6, if bins (n, M) were unpacked with the other number; else None.

    Neighbours resemble each other. Cut every 3 bits, whole bins differ less from the next than from the one after;
    halves of 6-bit bins differ more, a high half being like the next high half.
    """
    used = 6 if bins.max(initial=0) > 7 else 3
    thirds = bins if used == 3 else np.stack([bins & 7, bins >> 3], axis=-1).reshape(len(bins), -1)
    thirds = thirds.astype(np.int16)
    if np.count_nonzero(thirds) < ENOUGH_LIT:
        return None
    next_one = np.abs(thirds[:, 1:] - thirds[:, :-1]).mean()
    one_after = np.abs(thirds[:, 2:] - thirds[:, :-2]).mean()
    if used == 3:
        return 6 if next_one > CLEARLY * one_after else None
    return 3 if one_after > CLEARLY * next_one else None


def _radials(code: dict[str, npt.NDArray[np.uint16]], bins: npt.NDArray[np.uint8], settings: Profile) -> Radials:
    return Radials(
        label=REVERSED[code["label"]],
        control_accept=code["control_accept"].astype(np.uint8),
        slave=code["slave"].astype(np.bool_),
        annunciations=code["annunciations"].astype(np.uint8),
        faults=code["faults"].astype(np.uint8),
        stabilised=code["stabilised"].astype(np.bool_),
        mode=code["mode"].astype(np.uint8),
        tilt_deg=_signed(code["tilt"], 7) * f.TILT_LSB_DEG,
        gain_db=GAIN_DB[code["gain"]],
        range_nm=RANGE_NM[code["range"]],
        data_accept=code["data_accept"].astype(np.uint8),
        scan_angle_deg=_scan_angle(code["scan_angle"], settings),
        bins=bins,
    )


def _scan_angle(code: npt.NDArray[np.uint16], settings: Profile) -> npt.NDArray[np.float64]:
    # Half a turn, 2048 codes, lies between nose and tail; the sum is cut to 12 bits again.
    zero = 2048 if settings.scan_angle_zero == "tail" else 0
    return _signed((code + zero) & 0xFFF, 12) * f.SCAN_ANGLE_LSB_DEG


def _signed(code: npt.NDArray[np.integer[Any]], width: int) -> npt.NDArray[np.float64]:
    return np.where(code >> (width - 1), code - 2.0**width, code)


def _words(words: npt.ArrayLike, settings: Profile) -> npt.NDArray[np.uint8]:
    array = np.asarray(words)
    if array.ndim != 2 or array.shape[1] != settings.word_bytes:
        raise ValueError(
            f"words of shape {array.shape}: profile {settings.name} takes (n, {settings.word_bytes}) bytes"
            f" ({settings.word_bytes * 8} bits a word)"
        )
    if array.dtype != np.uint8:
        raise ValueError(f"words of type {array.dtype}: pass bytes, uint8")
    # One memory layout, so that the kernel is compiled once.
    return np.require(array, np.uint8, ["C", "A", "W"])
