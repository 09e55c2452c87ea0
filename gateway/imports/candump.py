"""Logs of `candump -l`, as can-utils and python-can write them, to frames as the CAN adapters record them."""

import re
import struct
from collections.abc import Iterable, Iterator

from decoders import formats as f
from gateway.config import OUR_NAMES
from gateway.errors import GatewayError
from gateway.imports import Piece
from gateway.imports.files import Source

LINE = re.compile(
    rb"\((?P<s>\d{1,10})\.(?P<fraction>\d{1,9})\) +(?P<interface>[!-~]{1,32}) +(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    rb"(?:#(?P<flags>[0-9A-Fa-f])(?P<fd>(?:[0-9A-Fa-f]{2}){0,64})|R(?P<remote>[0-8]?)|(?P<data>(?:[0-9A-Fa-f]{2}){0,8})"
    rb"(?:_[0-9A-Fa-f])?)(?: +[RT])?\s*"
)
FD_FRAME = 0x04  # of SocketCAN's FD flags: the frame has FD's form
REST = struct.Struct(f.CAN_RECORD.replace("Q", ""))  # the stamp stands before it
LONGEST_LINE = 512
MOST_INTERFACES = 64
MOST_NOTES, NOTE_CHARACTERS = 100, 200


def lines(source: Source) -> Iterator[bytes]:
    """The lines of a log; what has no end for too long is cut."""
    rest = b""
    for block in source.blocks():
        *whole, rest = (rest + block).split(b"\n")
        yield from whole
        while len(rest) > LONGEST_LINE:
            yield rest[:LONGEST_LINE]
            rest = rest[LONGEST_LINE:]
    if rest:
        yield rest


def survey(sources: Iterable[Source]) -> tuple[dict[str, str], int]:
    """The interfaces of all frames with a name for an adapter each, and the time in ns of the first frame.

    Raises GatewayError for files without a frame, or with those of more interfaces than a machine has.
    """
    names: dict[str, str] = {}
    first_ns = 0
    for source in sources:
        for line in lines(source):
            found = LINE.fullmatch(line)
            if not found:
                continue
            first_ns = first_ns if names else _time_ns(found)
            interface = found["interface"].decode()
            if interface not in names:
                names[interface] = _name(interface, names)
            if len(names) > MOST_INTERFACES:
                raise GatewayError(f"{source.path}: frames of more than {MOST_INTERFACES} interfaces: split the log")
    if not names:
        told = ", ".join(str(source.path) for source in sources)
        raise GatewayError(
            f"{told}: no line is a frame, such as (1780000000.123456) can0 16010056#0102: see candump -l"
        )
    return names, first_ns


def frames(sources: Iterable[Source], names: dict[str, str]) -> Iterator[Piece]:
    """Each frame as recorded, without its stamp. A line that is none becomes a note; the first 100 of them."""
    strange = 0
    time_ns: int | None = None
    any_adapter = next(iter(names.values()))
    for source in sources:
        for line in lines(source):
            found = LINE.fullmatch(line)
            record = _record(found) if found else None
            if found and record:
                time_ns = _time_ns(found)
                yield Piece(time_ns, names[found["interface"].decode()], record)
            elif line.strip():
                strange += 1
                if strange <= MOST_NOTES:
                    text = line[:NOTE_CHARACTERS].decode("ascii", "backslashreplace")
                    yield Piece(time_ns, any_adapter, b"", note=f"no frame: {text}")
    if strange:
        yield Piece(
            time_ns, any_adapter, b"", note=f"{strange} lines are no frames; up to {MOST_NOTES} are kept as notes"
        )


def _time_ns(found: re.Match[bytes]) -> int:
    return int(found["s"]) * 1_000_000_000 + int(found["fraction"].ljust(9, b"0"))


def _record(found: re.Match[bytes]) -> bytes | None:
    """Identifier with SocketCAN's flags, FD flags, length and data, or None for an identifier that cannot be."""
    identifier = int(found["id"], 16)
    if len(found["id"]) == 8 and not identifier & f.CAN_ERROR:
        if identifier > 0x1FFF_FFFF:
            return None
        identifier |= f.CAN_EXTENDED
    if found["remote"] is not None:
        length = int(found["remote"] or b"0")
        return REST.pack(identifier | f.CAN_REMOTE, 0, length) + bytes(length)
    if found["fd"] is not None:
        data = bytes.fromhex(found["fd"].decode())
        return REST.pack(identifier, int(found["flags"], 16) | FD_FRAME, len(data)) + data
    data = bytes.fromhex(found["data"].decode())
    return REST.pack(identifier, 0, len(data)) + data


def _name(interface: str, names: dict[str, str]) -> str:
    """A name that an adapter can have, and no other interface has."""
    name = base = re.sub(r"[^A-Za-z0-9_-]", "_", interface)
    number = 2
    while name in OUR_NAMES or name in names.values():
        name, number = f"{base}-{number}", number + 1
    return name
