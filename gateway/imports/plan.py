"""What is to be imported, and as which adapters: options and a rack file to the configuration of the new recording."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gateway.config import AdapterConfig, RackConfig, check_config, load_config
from gateway.errors import GatewayError

LAYOUTS = ("seqrecord", "mxf", "rdr4b", "candump")
MEANT_FOR = {
    "tick_ns": ("seqrecord", "mxf"),
    "flags_429": ("seqrecord", "mxf"),
    "flags_708": ("seqrecord", "mxf"),
    "size_bits": ("mxf",),
    "words_per_s": ("rdr4b",),
}
FLAG = re.compile(r"(429|708)\.([a-z_]+)=(0[xX][0-9A-Fa-f]+|\d+)")
KINDS = {"429": "arinc429", "708": "arinc708"}
LATEST_START = datetime(2100, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class Wish:
    """What is said on the command line."""

    files: Sequence[Path]
    layout: str
    channels: Mapping[int, dict[str, str]] = field(default_factory=dict)  # by number, in the order of the options
    vendor: Mapping[str, Any] = field(default_factory=dict)  # fields of a VendorConfig
    rack: Path | None = None
    start_utc_ns: int | None = None


def channels_of(texts: Sequence[str]) -> dict[int, dict[str, str]]:
    """Channels as `--channel` gives them, `N=KIND[:SET[:ORIENTATION]]`. Raises GatewayError for any other text."""
    channels: dict[int, dict[str, str]] = {}
    for text in texts:
        number, _, rest = text.partition("=")
        kind, *more = rest.split(":")
        kind = KINDS.get(kind, kind)
        names = ("definitions", "orientation") if kind == "arinc429" else ("profile",)
        if not number.isdecimal() or kind not in KINDS.values() or len(more) > len(names) or not all(more):
            raise GatewayError(
                f"--channel {text}: write N=arinc429:SET, N=arinc429:SET:label_swapped or N=arinc708:PROFILE"
            )
        if int(number) in channels:
            raise GatewayError(f"--channel {text}: channel {number} is said twice: leave one out")
        channels[int(number)] = {"kind": kind, **dict(zip(names, more, strict=False))}
    return channels


def flags_of(texts: Sequence[str]) -> dict[str, dict[str, int]]:
    """Masks as `--flag` gives them, such as `708.coding=0x10`. Raises GatewayError for any other text."""
    flags: dict[str, dict[str, int]] = {}
    for text in texts:
        found = FLAG.fullmatch(text)
        if not found:
            raise GatewayError(f"--flag {text}: write 429.NAME=MASK or 708.NAME=MASK, such as 708.coding=0x10")
        masks = flags.setdefault(f"flags_{found[1]}", {})
        if found[2] in masks:
            raise GatewayError(f"--flag {text}: {found[1]}.{found[2]} is said twice: leave one out")
        masks[found[2]] = int(found[3], 0)
    return flags


def utc_ns(text: str) -> int:
    """A time such as 2026-05-28T12:00:00Z in ns since 1970; one without a zone is UTC. Raises GatewayError."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError as error:
        raise GatewayError(f"--start-utc {text}: write it as 2026-05-28T12:00:00Z") from error
    time = time if time.tzinfo else time.replace(tzinfo=UTC)
    if not datetime(1970, 1, 1, tzinfo=UTC) <= time < LATEST_START:
        raise GatewayError(f"--start-utc {text}: name a time from 1970 to 2099")
    return round((time - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * 1e6) * 1000


def rack_of(wish: Wish, names: Mapping[str, str]) -> RackConfig:
    """The configuration of the recording, with an adapter for each of `names` (its name to its source).

    Raises GatewayError for options that the layout has no use for, or that contradict each other.
    """
    for option in wish.vendor:
        if wish.layout not in MEANT_FOR[option]:
            raise GatewayError(f"--{option.replace('_', '-')}: {wish.layout} has no use for it: leave it out")
    rack = load_config(wish.rack) if wish.rack else None
    base = rack.model_dump(exclude={"adapters", "recording"}) if rack else {}
    adapters = [_adapter(wish, rack, name, place, k) for k, (name, place) in enumerate(names.items())]
    return check_config({**base, "adapters": adapters}, "options")


def _adapter(wish: Wish, rack: RackConfig | None, name: str, place: str, number: int) -> dict[str, Any]:
    model = _model(rack, name)
    known = {n: channel.model_dump() for n, channel in model.channels.items()} if model else {}
    said = dict([[*wish.channels.items()][number]]) if wish.layout == "mxf" else wish.channels
    if wish.layout == "mxf":
        known = {n: channel for n, channel in known.items() if n in said}
    channels = {n: known.get(n, {}) | said.get(n, {}) for n in {**said, **known}}
    vendor = (model.vendor.model_dump(exclude_none=True) if model else {}) | dict(wish.vendor)
    framing = wish.layout
    if framing == "mxf":
        (channel,) = said.values()
        framing = "mxf429" if channel["kind"] == "arinc429" else "mxf708"
    return {"name": name, "source": f"file:{place}", "framing": framing, "channels": channels, "vendor": vendor}


def _model(rack: RackConfig | None, name: str) -> AdapterConfig | None:
    """The adapter of the rack file that says what the channels carry: that of the same name, or the only one."""
    if rack is None:
        return None
    same = [adapter for adapter in rack.adapters if adapter.name == name]
    if not same and len(rack.adapters) > 1:
        raise GatewayError(f"the rack file has several adapters and none is named {name!r}: name the right one so")
    return (same or rack.adapters)[0]
