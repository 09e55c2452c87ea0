"""Bus words as text, one line each: UTC of the word, adapter, channel, and the word with what it means."""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429, arinc708
from decoders import formats as f
from gateway.config import RackConfig
from gateway.console import clock
from gateway.errors import GatewayError
from gateway.link import FLAG_NAMES, SPOILT
from gateway.records import Record
from gateway.words import Block429, Item, Malformed, Word708, WordStage


class Wanted(NamedTuple):
    """Which words to show; an empty set stands for all. With labels no radar words are shown, which have none."""

    adapters: frozenset[str] = frozenset()
    channels: frozenset[int] = frozenset()
    labels: frozenset[int] = frozenset()

    @classmethod
    def of(cls, config: RackConfig, adapters: Iterable[str], channels: Iterable[int], labels: Iterable[str]) -> Self:
        """What these names stand for; labels are octal. Raises GatewayError for one that does not exist."""
        names = [one.name for one in config.adapters]
        for name in adapters:
            if name not in names:
                raise GatewayError(f"no adapter {name!r} in the recording: name one of {', '.join(names)}")
        for label in labels:
            if not re.fullmatch("[0-3]?[0-7]{1,2}", label):
                raise GatewayError(f"label {label!r} is not octal: write 000 to 377")
        return cls(frozenset(adapters), frozenset(channels), frozenset(int(label, 8) for label in labels))

    def takes(self, item: Item) -> bool:
        """Whether anything of a block, a radar word or a malformed packet may be shown."""
        here = item.adapter in (self.adapters or (item.adapter,)) and item.channel in (self.channels or (item.channel,))
        return here and (not self.labels or isinstance(item, Block429))

    def among(self, labels: NDArray[np.uint8]) -> NDArray[np.intp]:
        """Which words are to be shown of those with these labels (n,)."""
        return np.flatnonzero(np.isin(labels, [*self.labels])) if self.labels else np.arange(len(labels))


EVERYTHING = Wanted()


def lines(records: Iterable[Record], config: RackConfig, wanted: Wanted = EVERYTHING) -> Iterator[str]:
    """The lines of the wanted words in records."""
    stage = WordStage(config)
    for record in records:
        for item in stage.feed(record):
            if not wanted.takes(item):
                continue
            if isinstance(item, Malformed):
                yield f"{_place(item, item.utc_ns)}  malformed: {item.reason}"
            elif isinstance(item, Word708):
                yield f"{_place(item, item.utc_ns)}  708  {_radar(item)}{_flags(item.flags)}"
            else:
                yield from _words(item, wanted)


def _place(item: Item, utc_ns: int) -> str:
    return f"({clock(utc_ns)}) {item.adapter} {item.channel:3d}"


def _flags(flags: int) -> str:
    return "".join(f"  {name}" for bit, name in FLAG_NAMES.items() if flags & bit)


def _words(block: Block429, wanted: Wanted) -> Iterator[str]:
    shown = wanted.among(arinc429.unpack(block.words, block.orientation).label)
    meanings = _meanings(block)
    for k in shown.tolist():
        word = f"{block.words[k]:08x}  {meanings[k] if meanings else block.why_not_decoded}"
        yield f"{_place(block, int(block.utc_ns[k]))}  429  {word}{_flags(block.flags)}"


def _meanings(block: Block429) -> list[str]:
    """What each word of a block says; nothing if it is not decoded."""
    values = block.decoded()
    if values is None or block.reading is None:
        return []
    found = []
    for label, value, status in zip(*(column.tolist() for column in values), strict=True):
        definition = block.reading.definitions.labels.get(label)
        meaning = arinc429.Status(status).name
        if status == arinc429.Status.NORMAL and definition:
            meaning = f"{value:.9g} {definition.units}".rstrip()
        found.append(f"{label:03o} {definition.name if definition else 'unknown label'}: {meaning}")
    return found


def _radar(word: Word708) -> str:
    text = f"{word.data[: f.HEADER_708_BYTES].hex()}...  "
    readable = word.bit_count >= 8 * f.HEADER_708_BYTES and not word.flags & SPOILT & ~f.FLAG_WORD_LENGTH
    if not word.reading or not readable:
        return f"{text}{word.bit_count} bits, not decoded"
    array, profile = np.frombuffer(word.data, np.uint8)[np.newaxis], word.reading.profile
    if word.bit_count == profile.word_bits:
        radial = arinc708.unpack(array, profile)
        return f"{text}{_header(radial)}  {np.count_nonzero(radial.bins)} of {profile.bins} bins lit{_unusual(radial)}"
    header = arinc708.headers(array, profile)
    return f"{text}{_header(header)}  {word.bit_count} bits, bins not decoded{_unusual(header)}"


def _header(radial: arinc708.Header | arinc708.Radials) -> str:
    return (
        f"angle {radial.scan_angle_deg[0]:+8.3f}  tilt {radial.tilt_deg[0]:+6.2f}  "
        f"{radial.range_nm[0]:3.0f} NM  mode {radial.mode[0]}"
    )


def _unusual(radial: arinc708.Header | arinc708.Radials) -> str:
    return "".join(f"  {name}" for bit, name in enumerate(f.UNUSUAL_708) if radial.unusual[0] >> bit & 1)
