"""Bus words as text, one line each: UTC of reading, adapter, channel, and the word with what it means."""

from collections.abc import Iterable, Iterator

import numpy as np

from decoders import arinc429, arinc708
from decoders import formats as f
from decoders.racklink import MalformedBody, Packet, hello, radar_word, words429
from gateway.config import RackConfig
from gateway.console import clock
from gateway.link import FLAG_NAMES, SPOILT, Channel429, Channel708, Link
from gateway.records import Raw, Record


def lines(records: Iterable[Record], config: RackConfig) -> Iterator[str]:
    """The lines of all words in records."""
    links = {a.name: Link(a, config.radar_profile) for a in config.adapters}
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
    channel = link.channels.get(packet.channel)
    head = word.data[: f.HEADER_708_BYTES].hex()
    if not isinstance(channel, Channel708) or word.bit_count != f.WORD_708_BITS or packet.flags & SPOILT:
        return f"{head}...  {word.bit_count} bits, not decoded"
    radial = arinc708.unpack(np.frombuffer(word.data, np.uint8)[np.newaxis], channel.profile)
    lit = np.count_nonzero(radial.bins)
    return (
        f"{head}...  angle {radial.scan_angle_deg[0]:+8.3f}  tilt {radial.tilt_deg[0]:+6.2f}  "
        f"{radial.range_nm[0]:3.0f} NM  mode {radial.mode[0]}  {lit} of {radial.bins.shape[1]} bins lit"
    )
