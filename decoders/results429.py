"""What comes out of ARINC 429 words: their parts, their values, and what each value is worth."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Status(IntEnum):
    """What a value is worth. If several apply: BAD_PARITY, then UNKNOWN_LABEL, then the SSM's, then INVALID_DATA."""

    NORMAL = 0
    NO_COMPUTED_DATA = 1
    FUNCTIONAL_TEST = 2
    FAILURE_WARNING = 3
    BAD_PARITY = 4
    UNKNOWN_LABEL = 5
    INVALID_DATA = 6


class Words429(NamedTuple):
    """Parts of n words. `sdi` is bits 9-10 as they stand, also in 20-bit words, where they are data."""

    label: npt.NDArray[np.uint8]
    sdi: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint32]  # bits 11-29
    ssm: npt.NDArray[np.uint8]  # bits 30-31
    parity_ok: npt.NDArray[np.bool_]  # odd over the 32 bits


class Values429(NamedTuple):
    """Values of n words: `value` in the units of the label's definition, 0 where `status` is not Status.NORMAL."""

    label: npt.NDArray[np.uint8]
    value: npt.NDArray[np.float64]
    status: npt.NDArray[np.uint8]
