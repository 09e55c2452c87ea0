"""What the recording holds, in the order it happened: raw chunks, statuses, ticks and notes.

A raw record's payload in the file carries its own CRC-32, so a reader can tell a torn or altered chunk from a whole one
whatever happened to the file around it.
"""

import json
import struct
import zlib
from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True)
class Stamp:
    """When something happened: the host's monotonic clock for order and intervals, its UTC for people."""

    monotonic_ns: int
    utc_ns: int


@dataclass(frozen=True, slots=True)
class Raw:
    """Bytes as an adapter read them, and what was lost just before: bytes of a stream, or frames, or datagrams."""

    sequence: int
    stamp: Stamp
    adapter: str
    data: bytes
    dropped_before: int = 0


@dataclass(frozen=True, slots=True)
class Status:
    """A change of state of an adapter or of a part of the gateway."""

    sequence: int
    stamp: Stamp
    adapter: str
    state: str
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Tick:
    """Time passed: the only clock of everything that follows the recording."""

    sequence: int
    stamp: Stamp


@dataclass(frozen=True, slots=True)
class Note:
    """A remark on the recording itself, such as a step of UTC."""

    sequence: int
    stamp: Stamp
    text: str


Record = Raw | Status | Tick | Note

RAW_HEAD = struct.Struct("<QQQI")  # sequence, monotonic_ns, utc_ns, dropped_before; the chunk follows
RAW_LAYOUT = (
    "u32 crc32 of the rest, u64 sequence, u64 monotonic_ns, u64 utc_ns, u32 dropped_before, chunk; little-endian"
)
_CRC_SIZE = 4


class DamagedRecord(ValueError):
    """A payload that is not what was written."""


def raw_payload(record: Raw) -> bytes:
    """The bytes of a raw record in the file."""
    stamp = record.stamp
    head = RAW_HEAD.pack(record.sequence, stamp.monotonic_ns, stamp.utc_ns, min(record.dropped_before, 0xFFFFFFFF))
    body = head + record.data
    return zlib.crc32(body).to_bytes(_CRC_SIZE, "little") + body


def parse_raw(adapter: str, payload: bytes) -> Raw:
    """A raw record from its payload. Raises DamagedRecord where the CRC says so."""
    body = payload[_CRC_SIZE:]
    if len(body) < RAW_HEAD.size or int.from_bytes(payload[:_CRC_SIZE], "little") != zlib.crc32(body):
        raise DamagedRecord("the CRC of a raw chunk is wrong")
    sequence, monotonic_ns, utc_ns, dropped_before = RAW_HEAD.unpack_from(body)
    return Raw(sequence, Stamp(monotonic_ns, utc_ns), adapter, body[RAW_HEAD.size :], dropped_before)


def json_payload(record: Status | Tick | Note) -> bytes:
    """The bytes of any other record in the file: JSON that every MCAP tool shows."""
    return json.dumps(asdict(record), separators=(",", ":")).encode()


def parse_json(kind: type[Status] | type[Tick] | type[Note], payload: bytes) -> Record:
    """A status, tick or note from its payload. Raises DamagedRecord if it is none."""
    try:
        fields = json.loads(payload)
        return kind(**{**fields, "stamp": Stamp(**fields["stamp"])})
    except (ValueError, TypeError, KeyError) as error:
        raise DamagedRecord(f"{kind.__name__.lower()} record cannot be read: {error}") from error
