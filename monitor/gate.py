"""Whether the GNSS receiver itself vouches for its position: its mode (273), its integrity limit (130), and a failure.

A normal sign/status matrix on 110 and 111 says that a position was computed, not that it can be relied on.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from decoders.definitions import DefinitionError, Definitions
from monitor.aircraft import Aircraft, status_name
from monitor.geodesy import NM_M
from monitor.quantities import GNSS, GNSS_MODE, INTEGRITY_LIMIT, SATELLITE_FAILURE
from monitor.track import NORMAL

MODE_LABEL, MODE_BITS = 0o273, 5
# Bits 28 to 26 of label 273; bits 25 and 24 only tell kinds of navigation apart.
MODES: Final = (
    "self test", "initialisation", "acquisition", "navigation", "altitude aiding", "reserved", "aided", "fault",
)  # fmt: skip
USABLE_MODES: Final = frozenset((3, 4, 6))
VOUCHING: Final = (GNSS_MODE, INTEGRITY_LIMIT, SATELLITE_FAILURE)


def check_mode(definitions: Definitions) -> None:
    """Refuse, with DefinitionError, the set of a GNSS receiver whose mode has other bits than are read here."""
    row = definitions.labels.get(MODE_LABEL)
    if row is None or "mode" not in row.fields or definitions.equipment_id & 0xFF not in GNSS:
        return
    first, last = row.fields["mode"]
    if last - first + 1 != MODE_BITS:
        raise DefinitionError(
            f"[{definitions.name}] label {MODE_LABEL:03o}: mode has {last - first + 1} bits: give it all {MODE_BITS}, "
            "such as [24, 28], whose highest three say whether the receiver navigates"
        )


def position_doubts(
    aircraft: Aircraft, time_ns: NDArray[np.int64], largest_limit_nm: float
) -> tuple[NDArray[np.bool_], list[str]]:
    """At which times (n,) the position is not vouched for, and why, with the number of times.

    The end of scale of label 130, just below 16 NM, stands for a receiver that has no limit to give.
    """
    mode, limit, failure = (aircraft.tracks[quantity.name].at(time_ns) for quantity in VOUCHING)
    kind = mode.value.astype(np.intp) >> 2
    known = (mode.status == NORMAL) & (limit.status == NORMAL) & (failure.status == NORMAL)
    doubts: dict[str, NDArray[np.bool_]] = {}
    for name, values in zip((q.name for q in VOUCHING), (mode, limit, failure), strict=True):
        for status in sorted({*values.status.tolist()} - {NORMAL}):
            doubts[f"{name}: {status_name(status)}"] = values.status == status
    for code in sorted({*kind[known].tolist()} - USABLE_MODES):
        doubts[f"the GNSS receiver's mode is {MODES[code]}"] = known & (kind == code)
    loose = known & (limit.value > largest_limit_nm * NM_M)
    largest = limit.value[loose].max(initial=0.0) / NM_M
    doubts[f"the GNSS receiver's horizontal integrity limit is {largest:.6g} NM, above {largest_limit_nm:g}"] = loose
    doubts["the GNSS receiver has detected a satellite failure"] = known & (failure.value > 0)
    doubts["the GNSS receiver's horizontal integrity limit is 0, as no limit can be"] = known & (limit.value <= 0)
    reasons = [f"{why} on {np.count_nonzero(at)} of {len(time_ns)} radials" for why, at in doubts.items() if at.any()]
    return np.logical_or.reduce(list(doubts.values())), reasons
