"""How records lie in an MCAP file, for each version of the format; docs/recording.md has the same as tables.

Format 1 guards raw payloads alone. In format 2 every CRC-32 begins with the topic, so that a chunk of one adapter
cannot pass for another's, and the JSON payloads, the channels and the metadata carry one too.
"""

import json
import struct
import zlib
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from gateway.records import Note, Raw, Record, Stamp, Status, Tick

RECORD_HEAD = struct.Struct("<BQ")  # of every MCAP record: opcode, length of what follows
HEADER, CHANNEL, METADATA, METADATA_INDEX, DATA_END = 1, 4, 12, 13, 15  # opcodes
MAGIC = b"\x89MCAP0\r\n"
PROFILE = "shadebus"
FORMAT = "2"  # what is written today
LARGEST_RECORD = 16 << 20  # far above any chunk: a torn length must not ask for gigabytes
LARGEST_DESCRIPTION = 4 << 20  # of channels, metadata and JSON
RAW_HEAD = struct.Struct("<QQQI")  # sequence, monotonic_ns, utc_ns, dropped_before; the chunk follows
RAW_ENCODING, JSON_ENCODING = "x-shadebus-raw", "json"
KINDS: dict[str, type[Status] | type[Tick] | type[Note]] = {"/status": Status, "/tick": Tick, "/note": Note}
RAW_TOPIC = "/raw/"
CRC_KEY, FORMAT_KEY = "crc32", "format"
_FIELDS = "u64 sequence, u64 monotonic_ns, u64 utc_ns, u32 dropped_before, chunk; little-endian"
_U16, _U32 = struct.Struct("<H"), struct.Struct("<I")
_JSON_MARK = b',"crc32":'


class DamagedRecord(ValueError):
    """Bytes that are not what was written."""


class Layout(NamedTuple):
    """What differs between versions of the format."""

    topic_in_crc: bool
    json_has_crc: bool
    raw_text: str  # of a raw channel's metadata, for a reader without our page


LAYOUTS = {
    "1": Layout(False, False, f"u32 crc32 of the rest, {_FIELDS}"),
    FORMAT: Layout(True, True, f"u32 crc32 of the topic and then the rest, {_FIELDS}"),
}


class Topic(NamedTuple):
    """What a channel carries, and with what its CRCs begin."""

    name: str
    layout: Layout

    @property
    def seed(self) -> int:
        """The CRC-32 to go on from."""
        return zlib.crc32(self.name.encode()) if self.layout.topic_in_crc else 0

    @property
    def adapter(self) -> str | None:
        """The adapter of a topic of raw chunks."""
        return self.name.removeprefix(RAW_TOPIC) if self.name.startswith(RAW_TOPIC) else None


def topic_of(record: Record) -> str:
    """The topic under which a record lies."""
    return RAW_TOPIC + record.adapter if isinstance(record, Raw) else f"/{type(record).__name__.lower()}"


def payload(record: Record, seed: int) -> bytes:
    """The bytes of a record in the file: a raw chunk behind a small head, others as JSON that any MCAP tool shows."""
    if isinstance(record, Raw):
        stamp = record.stamp
        head = RAW_HEAD.pack(record.sequence, stamp.monotonic_ns, stamp.utc_ns, min(record.dropped_before, 0xFFFFFFFF))
        body = head + record.data
        return _U32.pack(zlib.crc32(body, seed)) + body
    fields = {**record._asdict(), "stamp": record.stamp._asdict()}
    body = json.dumps(fields, separators=(",", ":")).encode()[:-1]
    return body + _JSON_MARK + b"%d}" % zlib.crc32(body, seed)


def parse_payload(topic: Topic, data: bytes) -> Record:
    """A record from its payload. Raises DamagedRecord where its CRC or its form says so."""
    adapter = topic.adapter
    if adapter is None:
        return _parse_json(KINDS[topic.name], topic, data)
    body = data[_U32.size :]
    if len(body) < RAW_HEAD.size or data[: _U32.size] != _U32.pack(zlib.crc32(body, topic.seed)):
        raise DamagedRecord("the CRC of a raw chunk is wrong")
    sequence, monotonic_ns, utc_ns, dropped_before = RAW_HEAD.unpack_from(body)
    return Raw(sequence, Stamp(monotonic_ns, utc_ns), adapter, body[RAW_HEAD.size :], dropped_before)


def _parse_json(kind: type[Status] | type[Tick] | type[Note], topic: Topic, data: bytes) -> Record:
    name = kind.__name__.lower()
    if topic.layout.json_has_crc:
        body, mark, crc = data.rpartition(_JSON_MARK)
        if not mark or crc != b"%d}" % zlib.crc32(body, topic.seed):
            raise DamagedRecord(f"the CRC of a {name} is wrong")
        data = body + b"}"
    try:
        fields = json.loads(data)
        stamp = Stamp(**fields.pop("stamp"))
        record: Record = kind(**fields, stamp=stamp)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DamagedRecord(f"a {name} cannot be read: {error}") from error
    if any(type(number) is not int for number in (record.sequence, *stamp)) or not all(
        isinstance(text, str) for text in record[2:]
    ):
        raise DamagedRecord(f"a {name} has fields of the wrong kind")
    return record


def guarded(about: str, entries: Mapping[str, str]) -> dict[str, str]:
    """The entries of a channel's or the file's metadata with the format's version and their CRC-32."""
    marked = {**entries, FORMAT_KEY: FORMAT}
    return {**marked, CRC_KEY: str(_crc(about, marked.items()))}


def checked(about: str, entries: Mapping[str, str]) -> dict[str, str]:
    """The same without their CRC-32. Raises DamagedRecord if it is wrong, or missing where the format has one."""
    rest = {key: text for key, text in entries.items() if key != CRC_KEY}
    if CRC_KEY in entries and entries[CRC_KEY] != str(_crc(about, rest.items())):
        raise DamagedRecord("the CRC of a description is wrong")
    if CRC_KEY not in entries and FORMAT_KEY in entries:
        raise DamagedRecord("the CRC of a description is missing")
    return rest


def _crc(about: str, entries: Iterable[tuple[str, str]]) -> int:
    return zlib.crc32((about + "".join(key + text for key, text in entries)).encode())


def channel_entries(number: int, topic: str) -> tuple[str, dict[str, str]]:
    """The encoding and the metadata of a channel as it is written today."""
    raw = topic.startswith(RAW_TOPIC)
    encoding = RAW_ENCODING if raw else JSON_ENCODING
    about = {"layout": LAYOUTS[FORMAT].raw_text} if raw else {}
    return encoding, guarded(f"{number} {topic} {encoding}", about)


def parse_channel(content: bytes) -> tuple[int, Topic]:
    """A channel's number and topic from the content of its MCAP record. Raises DamagedRecord if it is none of ours."""
    if len(content) < 2 * _U16.size:
        raise DamagedRecord("a channel is too short")
    number, schema = _U16.unpack_from(content)[0], _U16.unpack_from(content, 2)[0]
    topic, at = _text(content, 4)
    encoding, at = _text(content, at)
    entries = checked(f"{number} {topic} {encoding}", _map(content, at))
    raw = topic.startswith(RAW_TOPIC)
    layout = layout_of(entries)
    described = {key: text for key, text in entries.items() if key != FORMAT_KEY}
    if (
        schema
        or not (raw or topic in KINDS)
        or encoding != (RAW_ENCODING if raw else JSON_ENCODING)
        or described != ({"layout": layout.raw_text} if raw else {})
    ):
        raise DamagedRecord("a channel is none of ours")
    return number, Topic(topic, layout)


def parse_metadata(content: bytes) -> dict[str, str]:
    """The file's metadata from the content of an MCAP record. Raises DamagedRecord if it is none of ours."""
    name, at = _text(content, 0)
    if name != PROFILE:
        raise DamagedRecord("metadata is none of ours")
    return checked(name, _map(content, at))


def layout_of(entries: Mapping[str, str]) -> Layout:
    """The layout that metadata names. Raises DamagedRecord for one that this version does not know."""
    version = entries.get(FORMAT_KEY, "1")
    if version not in LAYOUTS:
        raise DamagedRecord(f"format {version} is not known to this version")
    return LAYOUTS[version]


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A string with its length before it, as MCAP writes it, and where the next thing begins."""
    begin = at + _U32.size
    if begin > len(content):
        raise DamagedRecord("a description is too short")
    end = begin + _U32.unpack_from(content, at)[0]
    if end > len(content):
        raise DamagedRecord("a description is too short")
    try:
        return content[begin:end].decode(), end
    except UnicodeDecodeError as error:
        raise DamagedRecord("a description is no text") from error


def _map(content: bytes, at: int) -> dict[str, str]:
    """The map that ends a record."""
    if content[at : at + _U32.size] != _U32.pack(max(len(content) - at - _U32.size, 0)):
        raise DamagedRecord("a description has the wrong length")
    at += _U32.size
    entries: dict[str, str] = {}
    while at < len(content):
        key, at = _text(content, at)
        entries[key], at = _text(content, at)
    return entries
