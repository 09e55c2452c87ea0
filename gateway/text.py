"""Bus words as text, one line each: UTC of reading, adapter, channel, and the word with what it means."""

from collections.abc import Iterable, Iterator

import numpy as np

from decoders import arinc429, arinc708
from decoders import formats as f
from decoders.racklink import MalformedBody, Packet, hello, radar_word, words429
from gateway.channels import Channel429
from gateway.config import RackConfig, profile_of
from gateway.console import clock
from gateway.link import FLAG_NAMES, SPOILT, Link
from gateway.records import Raw, Record


def lines(records: Iterable[Record], config: RackConfig) -> Iterator[str]:
    """The lines of all words in records."""
    links = {a.name: Link(a, profile_of(config.radar_profile)) for a in config.adapters}
    for record in records:
        if not isinstance(record, Raw) or record.adapter not in links:
            continue
        link = links[record.adapter]
        for packet in link.framer.feed(record.data):
            flags = "".join(f"  {name}" for bit, name in FLAG_NAMES.items() if packet.flags & bit)
            place = f"({clock(record.stamp.utc_ns)}) {record.adapter} {packet.channel:3d}"
            try:
                if packet.type == f.HELLO:
                    link.hello(hello(packet))
                elif packet.type == f.WORDS_429:
                    yield from (f"{place}  429  {text}{flags}" for text in _words(link, packet))
                elif packet.type == f.WORD_708:
                    yield f"{place}  708  {_radar(link, packet)}{flags}"
            except MalformedBody as error:
                yield f"{place}  malformed: {error}"


def _words(link: Link, packet: Packet) -> Iterator[str]:
    block = words429(packet)
    link.identify(packet)
    channel = link.channels.get(packet.channel)
    if not isinstance(channel, Channel429) or packet.flags & SPOILT:
        why = "not decoded" if packet.flags & SPOILT else "channel without definitions"
        yield from (f"{word:08x}  {why}" for word in block.words.tolist())
        return
    values = arinc429.decode(block.words, channel.definitions, channel.orientation)
    for k, word in enumerate(block.words.tolist()):
        label, status = int(values.label[k]), int(values.status[k])
        definition = channel.definitions.labels.get(label)
        meaning = arinc429.Status(status).name
        if status == arinc429.Status.NORMAL and definition:
            meaning = f"{values.value[k]:.9g} {definition.units}".rstrip()
        yield f"{word:08x}  {label:03o} {definition.name if definition else 'unknown label'}: {meaning}"


def _radar(link: Link, packet: Packet) -> str:
    word = radar_word(packet)
    channel = link.radar(packet.channel)
    text = f"{word.data[: f.HEADER_708_BYTES].hex()}...  "
    readable = word.bit_count >= 8 * f.HEADER_708_BYTES and not packet.flags & SPOILT & ~f.FLAG_WORD_LENGTH
    if not channel or not readable:
        return f"{text}{word.bit_count} bits, not decoded"
    array, profile = np.frombuffer(word.data, np.uint8)[np.newaxis], channel.profile
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
