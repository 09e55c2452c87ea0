"""What a sound index says: what is on the channels, and where metadata lies; for where a file's beginning is lost."""

import struct
from collections.abc import Iterator

from gateway.recording.layout import (
    CHANNEL,
    LARGEST_DESCRIPTION,
    METADATA,
    METADATA_INDEX,
    RECORD_HEAD,
    DamagedRecord,
    Topic,
    parse_channel,
    parse_metadata,
)
from gateway.recording.window import Window

_PLACE = struct.Struct("<QQ")  # of metadata: offset and length of its record


def topics(window: Window) -> dict[int, Topic]:
    """By number, the channels of ours that the index lists."""
    found = {}
    for content in _records(window.index, CHANNEL):
        try:
            number, topic = parse_channel(content)
        except DamagedRecord:
            continue
        found[number] = topic
    return found


def metadata(window: Window) -> dict[str, str]:
    """The metadata that stands last in the file and is whole; none where the index knows of none."""
    for place in reversed([*_records(window.index, METADATA_INDEX)]):
        if len(place) < _PLACE.size:
            continue
        offset, length = _PLACE.unpack_from(place)
        for content in _records(window.read(offset, min(length, LARGEST_DESCRIPTION)), METADATA):
            try:
                return parse_metadata(content)
            except DamagedRecord:
                continue
    return {}


def _records(data: bytes, wanted: int) -> Iterator[bytes]:
    """The contents of the MCAP records of one kind that follow each other in some bytes."""
    at = 0
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        at += RECORD_HEAD.size
        if opcode == wanted and at + length <= len(data):
            yield data[at : at + length]
        at += length
