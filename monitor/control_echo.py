"""Does the radar do what its panel asks? The commands of the control words against their echo in the radar's header.

A radar takes a while to follow, so that what is compared must have been asked for unchanged for a settable delay.
After each change of the command a mismatch is told once, and once that it has ended: a radar that moves its antenna by
itself would fill the log otherwise. Every radial that differs is counted all the same.
"""

import math
from typing import Final, NamedTuple

from decoders.arinc708 import Radials
from decoders.control708 import Command
from decoders.formats import ANNUNCIATIONS_708, RANGE_LSB_NM

COMMAND_STALE_NS: Final = 5_000_000_000  # a panel speaks each 0.1 s; of a silent one nothing is known


class Finding(NamedTuple):
    """What is to be told: the state's name, and both values of what differs or differed."""

    state: str
    reason: str


class ControlEcho:
    """Takes commands and radials in order of time. `unlike` counts the radials that differed."""

    def __init__(self, delay_s: float = 1.0) -> None:
        self.unlike = 0
        self._delay_ns = round(delay_s * 1e9)
        self.forget()

    def forget(self) -> None:
        """Begin anew, as if no command had been heard."""
        self.command = Command()  # the latest
        self._changed_ns = 0
        self._heard_ns: int | None = None
        self._told = False  # whether a mismatch was told since the command changed
        self._open = False  # whether one was told that has not been told to be over

    @property
    def listens(self) -> bool:
        """Whether a panel has been heard, so that there is something to compare."""
        return self._heard_ns is not None

    def feed_command(self, time_ns: int, command: Command) -> None:
        """Take what the panel asks for now."""
        self._heard_ns = time_ns
        if any(_differ(new, old) for new, old in zip(command, self.command, strict=True)):
            self.command, self._changed_ns, self._told = command, time_ns, False

    def feed_radial(self, time_ns: int, radials: Radials, k: int = 0) -> Finding | None:
        """Compare radial k; what is to be told of it, if anything."""
        if self._heard_ns is None or time_ns - self._heard_ns > COMMAND_STALE_NS:
            return None
        if time_ns - self._changed_ns < self._delay_ns:
            return None
        asked, echo = _asked(self.command), _echo(radials, k)
        unlike = [
            f"{name}: panel {_text(value)}, radar {_text(echo[name])}"
            for name, value in asked.items()
            if value is not None and _differ(value, echo[name])
        ]
        self.unlike += bool(unlike)
        if unlike and not self._told:
            self._told = self._open = True
            return Finding("ECHO_MISMATCH", "; ".join(unlike))
        if not unlike and self._open:
            self._open = False
            return Finding("ECHO_AGREES", "the radar does what its panel asks")
        return None


def _asked(command: Command) -> dict[str, float | None]:
    said = [bit for bit in (command.anti_clutter, command.anti_clutter_2) if bit is not None]
    carried = command.range_nm is not None and command.range_nm % RANGE_LSB_NM == 0  # a divided range has no code
    return {
        "mode": command.mode,
        "tilt_deg": command.tilt_deg,
        "gain_db": command.gain_db,
        "range_nm": command.range_nm if carried else None,
        "stabilised": command.stabilised,
        "sector_scan": command.sector_scan,
        "anti_clutter": any(said) if said else None,
    }


def _echo(radials: Radials, k: int) -> dict[str, float]:
    annunciations = {name: bool(radials.annunciations[k] >> bit & 1) for bit, name in enumerate(ANNUNCIATIONS_708)}
    return {
        "mode": int(radials.mode[k]),
        "tilt_deg": float(radials.tilt_deg[k]),
        "gain_db": float(radials.gain_db[k]),
        "range_nm": float(radials.range_nm[k]),
        "stabilised": bool(radials.stabilised[k]),
        "sector_scan": annunciations["sector_scan"],
        "anti_clutter": annunciations["anti_clutter"],
    }


def _differ(left: float | None, right: float | None) -> bool:
    if left is None or right is None:
        return left is not right
    return left != right and not (math.isnan(left) and math.isnan(right))


def _text(value: float) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return "calibrated" if math.isnan(value) else f"{value:g}"
