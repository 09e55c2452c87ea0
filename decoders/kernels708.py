"""The loop over ARINC 708 words, compiled; `decoders.arinc708` says what the codes mean and checks the arguments."""

import numpy as np
import numpy.typing as npt
from numba import njit

from decoders.formats import HEADER_708_BYTES


@njit(cache=True)
def unpack(
    words: npt.NDArray[np.uint8],
    fields: npt.NDArray[np.int64],
    bits_per_bin: int,
    codes: npt.NDArray[np.uint16],
    bins: npt.NDArray[np.uint8],
) -> None:
    """Fill `codes` (fields, n) for `fields` of first bit and width, least significant bit first, and `bins` (n, M)."""
    for i in range(words.shape[0]):
        _header(words[i], fields, codes[:, i])
        _payload(words[i], bits_per_bin, bins[i])


@njit(cache=True)
def _header(word: npt.NDArray[np.uint8], fields: npt.NDArray[np.int64], codes: npt.NDArray[np.uint16]) -> None:
    header = np.int64(0)
    for place in range(HEADER_708_BYTES):
        header |= np.int64(word[place]) << (8 * place)
    for field in range(fields.shape[0]):
        first, width = fields[field]
        codes[field] = (header >> first) & ((1 << width) - 1)


@njit(cache=True)
def _payload(word: npt.NDArray[np.uint8], bits_per_bin: int, bins: npt.NDArray[np.uint8]) -> None:
    # Three bytes hold a whole number of bins, the nearest in the lowest bits.
    bins_per_group = 24 // bits_per_bin
    mask = (1 << bits_per_bin) - 1
    for group in range(bins.size // bins_per_group):
        first = HEADER_708_BYTES + 3 * group
        bits = np.int64(word[first]) | np.int64(word[first + 1]) << 8 | np.int64(word[first + 2]) << 16
        for place in range(bins_per_group):
            bins[group * bins_per_group + place] = (bits >> (place * bits_per_bin)) & mask
