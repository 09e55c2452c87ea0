"""What `shadebus replay` is told beyond the recording: a speed, other names for adapters, a step at a time."""

import math
import os
import select
import sys
import threading
from collections.abc import Sequence

from gateway.config import RackConfig, check_config
from gateway.errors import GatewayError

SLOWEST = 0.001
POLL_S = 0.1
LARGEST_READ = 4096


def speed_of(text: str) -> float | None:
    """Times real time, or None for `max`. Raises GatewayError for any other text."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not SLOWEST <= speed < math.inf:
        raise GatewayError(f"--speed {text}: write a number from {SLOWEST:g}, 1 being real time, or max")
    return speed


def names_of(texts: Sequence[str], config: RackConfig) -> dict[str, str]:
    """New names by old ones, as `--rename OLD=NEW` gives them. Raises GatewayError for an adapter that there is not."""
    known = [adapter.name for adapter in config.adapters]
    names: dict[str, str] = {}
    for text in texts:
        old, equals, new = text.partition("=")
        if not (old and equals and new):
            raise GatewayError(f"--rename {text}: write OLD=NEW")
        if old not in known:
            raise GatewayError(f"--rename {text}: no adapter is named {old!r}, use one of {', '.join(known)}")
        if old in names:
            raise GatewayError(f"--rename {text}: {old!r} is to be {names[old]!r} already: leave one out")
        names[old] = new
    return names


def renamed(config: RackConfig, names: dict[str, str]) -> RackConfig:
    """The configuration with the new names. Raises GatewayError for a name that is none, or is there already."""
    if not names:
        return config
    table = config.model_dump()
    for adapter in table["adapters"]:
        adapter["name"] = names.get(adapter["name"], adapter["name"])
    return check_config(table, "--rename")


class Steps:
    """One line of standard input for each step; once it has ended, steps are not waited for."""

    def __init__(self) -> None:
        self._rest = b""
        self._ended = False

    def wait(self, stop: threading.Event) -> None:
        """Return when Enter is pressed, at the end of the input or at the order to stop."""
        if sys.stdin is None or self._ended:
            return
        line = sys.stdin.fileno()
        if os.isatty(line):
            print("Enter for the next scan", file=sys.stderr, end="  ", flush=True)  # noqa: T201 # asks its user
        while b"\n" not in self._rest and not self._ended and not stop.is_set():
            if select.select([line], [], [], POLL_S)[0]:
                some = os.read(line, LARGEST_READ)
                self._ended = not some
                self._rest += some
        self._rest = self._rest.partition(b"\n")[2]
