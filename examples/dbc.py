"""Writes racklink.dbc, RackLink's CAN frames for CAN tools, from the formats and label sets: `make dbc`."""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from struct import calcsize
from typing import NamedTuple

from decoders import formats as f
from decoders.definitions import Definition, load_definitions

FILE = Path(__file__).with_name("racklink.dbc")
SETS = {1: "iru_704", 2: "gnss_743a"}  # by channel
RADARS = {0: ("fd", 1), 8: ("classic", 3)}  # by channel: frames, and how many of them carry the head and the header

ABOUT = """RackLink 1 over CAN, for an example of a bridge: channel 0 a weather radar in FD frames, channel 1 an
IRU, channel 2 a GNSS receiver, channel 8 a second radar in classic frames. An identifier is 0b10110 in bits 28 to
24, the channel in 23 to 16, the kind in 15 to 12 (0 ARINC 429 word, 1 part of an ARINC 708 word, 2 heartbeat) and
the index in 11 to 0: the low byte of an ARINC 429 word, which is its label with the bits reversed, or the number of
a segment. For another channel add 0x10000 for each step; for another label put its reversed bits into the low byte.
Later segments of a radar word carry range bins alone and are not described. Where a field is cut by the end of a
frame, its parts add up."""

HEAD = """VERSION ""

NS_ :

BS_:

BU_: bridge
"""
FRAME_FORMATS = ["StandardCAN", "ExtendedCAN", *12 * ["reserved"], "StandardCAN_FD", "ExtendedCAN_FD"]
ATTRIBUTES = f"""BA_DEF_ "BusType" STRING ;
BA_DEF_ BO_ "VFrameFormat" ENUM {",".join(f'"{name}"' for name in FRAME_FORMATS)};
BA_DEF_DEF_ "BusType" "CAN FD";
BA_DEF_DEF_ "VFrameFormat" "ExtendedCAN";
BA_ "BusType" "CAN FD";"""

SCALED = ("bnr", "bnr_unsigned")
PARTS: Mapping[str, Mapping[str, tuple[int, ...]]] = {  # of words that are not one value: first bit and width of each
    "time": f.TIME_FIELDS,
    "clock": f.CLOCK_DIGITS,
    "date": f.DATE_DIGITS,
}

SCALES: Mapping[str, tuple[Fraction, str, bool]] = {  # of the radar word's header: LSB, unit, signed or not
    "tilt": (Fraction(f.TILT_LSB_DEG), "deg", True),
    "gain": (Fraction(f.GAIN_LSB_DB), "dB", False),
    "range": (Fraction(f.RANGE_LSB_NM), "NM", False),
    "scan_angle": (Fraction(f.SCAN_ANGLE_LSB_DEG), "deg", False),
}
UNSCALED = (Fraction(1), "", False)


def reversed_bits(label: int) -> int:
    """A label as it lies in the low byte of a word."""
    return int(f"{label:08b}"[::-1], 2)


MEANINGS: Mapping[str, Mapping[int, str]] = {
    "label": {reversed_bits(f.LABEL_708): f"{f.LABEL_708:03o}"},
    "mode": {code: name for name, code in f.MODES_708.items()},
    "gain": {f.GAIN_CALIBRATED: "calibrated"},
    "range": {0: f"{f.RANGE_CODE_ZERO_NM} NM"},
}


class Signal(NamedTuple):
    """A field of a frame, the first bit of its data counted as 0."""

    name: str
    first: int
    width: int
    scale: Fraction = Fraction(1)
    unit: str = ""
    signed: bool = False
    meanings: Mapping[int, str] = {}


class Message(NamedTuple):
    """A frame of one identifier."""

    identifier: int
    name: str
    size: int
    signals: tuple[Signal, ...]
    comment: str


def messages() -> Iterator[Message]:
    """Every frame of the example."""
    for channel, (form, count) in RADARS.items():
        yield from (segment(channel, number, form) for number in range(count))
    for channel, name in SETS.items():
        for _, row in sorted(load_definitions(name).labels.items()):
            yield word429(channel, name, row)
    for channel in sorted((*RADARS, *SETS)):
        yield heartbeat(channel)


def identifier(channel: int, kind: int, index: int) -> int:
    """The identifier of 29 bits."""
    return f.CAN_PREFIX << 24 | channel << 16 | kind << 12 | index


def word429(channel: int, set_name: str, row: Definition) -> Message:
    """The frame of one label."""
    raw = reversed_bits(row.label)
    octal = f"{row.label:03o}"
    ends = (
        Signal("label", 0, 8, meanings={raw: octal}),
        *([Signal("sdi", 8, 2)] if row.has_sdi else []),
        Signal("ssm", 29, 2, meanings=dict(enumerate(f.SSM_TABLES[row.ssm]))),
        Signal("parity", 31, 1),
        Signal("bridge_time", 32, 32, unit="us"),
    )
    signals = (*ends, *values(row))
    name = f"{set_name}_{octal}"
    return Message(identifier(channel, f.CAN_WORD_429, raw), name, calcsize(f.CAN_429), signals, row.name)


def values(row: Definition) -> Iterator[Signal]:
    """The value of a word, or its parts, and the discrete bits beside it."""
    first, last = row.bits
    width = last - first + 1
    if row.encoding in SCALED:  # the sign of a signed one is bit 29, behind its last
        signed = row.encoding == "bnr"
        yield Signal("value", first - 1, width + signed, row.lsb, row.units, signed)
    elif row.encoding in PARTS:
        yield from (Signal(name, at - 1, bits) for name, (at, bits, *_) in PARTS[row.encoding].items())
    elif not row.fields:
        yield Signal("data", first - 1, width)
    yield from (Signal(name, low - 1, high - low + 1) for name, (low, high) in row.fields.items())


def radar_fields() -> Iterator[Signal]:
    """The record of a radar word up to the end of the word's header."""
    at = 0
    for name, code in zip(("time_ns", "bit_count", "flags"), f.CAN_708_HEAD[1:], strict=True):
        width = 8 * calcsize(f"<{code}")
        yield Signal(name, at, width, unit="ns" if name == "time_ns" else "")
        at += width
    for name, (first, width) in f.HEADER_708.items():
        yield Signal(name, at + first, width, *SCALES.get(name, UNSCALED), MEANINGS.get(name, {}))


def segment(channel: int, number: int, form: str) -> Message:
    """A frame with the word counter and its share of the record."""
    begin = 8 * f.CAN_SEGMENT_BYTES[form] * number
    end = begin + 8 * f.CAN_SEGMENT_BYTES[form]
    shares = [Signal("word_counter", 0, 8)]
    for field in radar_fields():
        low, high = max(field.first, begin), min(field.first + field.width, end)
        if low >= high:
            continue
        cut = low - field.first
        name = f"{field.name}_from_bit_{cut}" if cut else field.name
        shares.append(field._replace(name=name, first=8 + low - begin, width=high - low, scale=field.scale * 2**cut))
    comment = f"ARINC 708 word, segment {number} of those in {form} frames"
    name = f"radar_{channel}_segment_{number}"
    size = 1 + f.CAN_SEGMENT_BYTES[form]
    return Message(identifier(channel, f.CAN_WORD_708, number), name, size, tuple(shares), comment)


def heartbeat(channel: int) -> Message:
    """The counts of a channel."""
    counts = (Signal("words_received", 0, 32), Signal("words_lost", 32, 32))
    comment = f"Heartbeat of channel {channel}"
    size = calcsize(f.CAN_COUNTS)
    return Message(identifier(channel, f.CAN_HEARTBEAT, 0), f"heartbeat_{channel}", size, counts, comment)


def text() -> str:
    """The whole file."""
    found = list(messages())
    blocks = [HEAD, *map(_layout, found), f'CM_ "{ABOUT}";', *map(_comment, found), ATTRIBUTES]
    fd = FRAME_FORMATS.index("ExtendedCAN_FD")
    blocks += [f'BA_ "VFrameFormat" BO_ {_number(one)} {fd};' for one in found if one.size > 8]
    blocks += [_meanings(one, signal) for one in found for signal in one.signals if signal.meanings]
    return "\n".join(blocks) + "\n"


def _number(message: Message) -> int:
    return message.identifier | 1 << 31  # DBC's sign of an extended identifier


def _layout(message: Message) -> str:
    lines = [f"BO_ {_number(message)} {message.name}: {message.size} bridge"]
    for one in sorted(message.signals, key=lambda signal: signal.first):
        scale = one.scale.numerator if one.scale.denominator == 1 else repr(float(one.scale))
        bits = f"{one.first}|{one.width}@1{'-' if one.signed else '+'}"
        lines.append(f' SG_ {one.name} : {bits} ({scale},0) [0|0] "{one.unit}" Vector__XXX')
    return "\n".join(lines) + "\n"


def _comment(message: Message) -> str:
    return f'CM_ BO_ {_number(message)} "{message.comment}";'


def _meanings(message: Message, signal: Signal) -> str:
    said = " ".join(f'{code} "{name}"' for code, name in signal.meanings.items())
    return f"VAL_ {_number(message)} {signal.name} {said} ;"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="ascii")
