"""Encode ARINC 708 radar words: a 64-bit header and 1536 payload bits, bit 0 of byte 0 first on the wire.

The payload is either 512 range bins of 3 bits or, re-cut as Young, Uijt de Haag and Campbell (2004) recorded it,
256 bins of 6 bits; the number of bins decides.
"""

import math
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decoders.formats import (
    GAIN_CALIBRATED,
    HEADER_708,
    LABEL_708,
    MODES_708,
    RANGE_CODE_ZERO_NM,
    RANGE_LSB_NM,
    SCAN_ANGLE_LSB_DEG,
    TILT_LSB_DEG,
)

Codes = NDArray[np.int64]

PAYLOAD_BITS = 1536
BITS_PER_BIN = {512: 3, 256: 6}


class Header(TypedDict, total=False):
    """The optional keywords of `encode`; `encode_block` tells their meaning and defaults."""

    label: int
    control_accept: int
    slave: int
    annunciations: int
    faults: int
    stabilised: bool
    mode: int
    gain_db: float
    data_accept: int


def encode(
    bins: ArrayLike, *, scan_angle_deg: float, tilt_deg: float, range_nm: float, **header: Unpack[Header]
) -> bytes:
    """One word of 200 bytes from bins (512,) of 0..7 or (256,) of 0..63; raises ValueError as `encode_block` does."""
    block = np.asarray(bins)[None]
    words = encode_block(block, scan_angle_deg=[scan_angle_deg], tilt_deg=tilt_deg, range_nm=range_nm, **header)
    return words.tobytes()


def encode_block(
    bins: NDArray[np.integer],
    *,
    scan_angle_deg: ArrayLike,
    tilt_deg: ArrayLike,
    range_nm: float,
    label: int = LABEL_708,
    control_accept: int = 3,
    slave: int = 0,
    annunciations: int = 0,
    faults: int = 0,
    stabilised: bool = True,
    mode: int = MODES_708["map"],
    gain_db: float = math.nan,
    data_accept: int = 3,
) -> NDArray[np.uint8]:
    """Words (n, 200) from bins (n, 512) or (n, 256); scan angle clockwise from the nose, tilt up positive, in degrees.

    `annunciations` holds wire bits 13 to 17 and `faults` bits 18 to 24, the first bit as 1. `gain_db` is 0 for
    maximum, NaN for calibrated, otherwise -1 to -62. Raises ValueError for a field that its bits cannot hold.
    """
    codes: dict[str, ArrayLike] = {
        "label": int(f"{label:08b}"[::-1], 2),  # the one field sent most significant bit first
        "control_accept": control_accept,
        "slave": slave,
        "annunciations": annunciations,
        "faults": faults,
        "stabilised": int(stabilised),
        "mode": mode,
        "tilt": _tilt_code(tilt_deg),
        "gain": GAIN_CALIBRATED if math.isnan(gain_db) else round(-gain_db),
        "range": _range_code(range_nm),
        "data_accept": data_accept,
        "scan_angle": np.rint(np.asarray(scan_angle_deg, np.float64) / SCAN_ANGLE_LSB_DEG).astype(np.int64) & 0xFFF,
    }
    header = np.zeros(len(bins), np.uint64)
    for name, (first_bit, width) in HEADER_708.items():
        header |= _fitting(name, codes[name], width) << np.uint64(first_bit)
    return np.concatenate([header.astype("<u8").view(np.uint8).reshape(-1, 8), _payload(bins)], axis=1)


def _fitting(name: str, code: ArrayLike, width: int) -> NDArray[np.uint64]:
    codes = np.asarray(code, np.int64)
    if np.any((codes < 0) | (codes >= 2**width)):
        raise ValueError(f"header field {name} has {width} bits for 0 to {2**width - 1}, which cannot hold {codes}")
    return codes.astype(np.uint64)


def _tilt_code(tilt_deg: ArrayLike) -> Codes:
    """Seven bits of two's complement in quarters of a degree."""
    quarters = np.rint(np.asarray(tilt_deg, np.float64) / TILT_LSB_DEG).astype(np.int64)
    if np.any((quarters < -64) | (quarters > 63)):
        raise ValueError(f"tilt {np.asarray(tilt_deg)} is outside -16 to +15.75 degrees")
    return np.asarray(quarters & 0x7F)


def _range_code(range_nm: float) -> int:
    """Multiples of 5 NM; the code 0 stands for 320 NM."""
    code = range_nm / RANGE_LSB_NM
    if not (code.is_integer() and 0 < range_nm <= RANGE_CODE_ZERO_NM):
        raise ValueError(f"range {range_nm} NM cannot be sent: choose a multiple of 5 from 5 to 320")
    return int(code) % 64


def _payload(bins: NDArray[np.integer]) -> NDArray[np.uint8]:
    width = BITS_PER_BIN.get(bins.shape[1])
    if width is None:
        raise ValueError(f"a word holds 512 bins of 3 bits or 256 of 6, not {bins.shape[1]} bins")
    if bins.size and (bins.min() < 0 or bins.max() >= 2**width):
        raise ValueError(
            f"{bins.shape[1]} bins hold codes 0 to {2**width - 1}: {bins.min()} to {bins.max()} were given"
        )
    bits = np.unpackbits(bins.astype(np.uint8)[..., None], axis=2, bitorder="little")[..., :width]
    return np.packbits(bits.reshape(len(bins), PAYLOAD_BITS), axis=1, bitorder="little")
