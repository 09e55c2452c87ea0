"""What comes out of ARINC 708 words: header fields in engineering units, range bins, and what is unusual in them."""

from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt


class Header(NamedTuple):
    """Header fields of n words, (n,) each. Bits in brackets, bit 0 the first on the wire."""

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
    unusual: npt.NDArray[np.uint8]  # what the profile does not expect, bits named in `formats.UNUSUAL_708`

    @classmethod
    def empty(cls, n: int) -> Self:
        """Room for n words, not filled."""
        return cls(
            label=np.empty(n, np.uint8),
            control_accept=np.empty(n, np.uint8),
            slave=np.empty(n, np.bool_),
            annunciations=np.empty(n, np.uint8),
            faults=np.empty(n, np.uint8),
            stabilised=np.empty(n, np.bool_),
            mode=np.empty(n, np.uint8),
            tilt_deg=np.empty(n),
            gain_db=np.empty(n),
            range_nm=np.empty(n),
            data_accept=np.empty(n, np.uint8),
            scan_angle_deg=np.empty(n),
            unusual=np.empty(n, np.uint8),
        )


class Radials(NamedTuple):
    """n radials: the fields of `Header`, and the range bins, whose reserved levels `unusual` tells too."""

    label: npt.NDArray[np.uint8]
    control_accept: npt.NDArray[np.uint8]
    slave: npt.NDArray[np.bool_]
    annunciations: npt.NDArray[np.uint8]
    faults: npt.NDArray[np.uint8]
    stabilised: npt.NDArray[np.bool_]
    mode: npt.NDArray[np.uint8]
    tilt_deg: npt.NDArray[np.float64]
    gain_db: npt.NDArray[np.float64]
    range_nm: npt.NDArray[np.float64]
    data_accept: npt.NDArray[np.uint8]
    scan_angle_deg: npt.NDArray[np.float64]
    bins: npt.NDArray[np.uint8]  # (n, M), nearest first, 3 or 6 bits each
    unusual: npt.NDArray[np.uint8]


class Meanings(NamedTuple):
    """A profile as the kernel of the header reads it."""

    labels: npt.NDArray[np.uint8]  # that are expected
    reserved_modes: npt.NDArray[np.uint8]  # codes
    scan_angle_zero: int  # code of the nose's opposite, 2048, if the radar counts from the tail, else 0
    scan_angle_sense: int  # 1 clockwise, -1 counterclockwise
