"""Byte layouts as `construct` declarations: the executable specification of all that is not read with them.

RackLink 1, the ARINC 708 header, and the records of makers' interface cards.

They are written field by field in the order of the wire, apart from the tables of `decoders.formats`, so that the
fast readers can be tested against something that was not derived from them. In service they read only the rare packets.
"""

from typing import Any

from construct import (
    BitsInteger,
    BitsSwapped,
    BitStruct,
    Byte,
    Bytes,
    Const,
    Construct,
    ExprAdapter,
    Flag,
    GreedyRange,
    Int16ul,
    Int32ul,
    Int64ul,
    Struct,
    Terminated,
    this,
)

PACKET_HEADER = Struct(
    "version" / Const(1, Byte),
    "type" / Byte,
    "channel" / Byte,
    "flags" / Byte,
    "sequence" / Int32ul,
    "time_ns" / Int64ul,
)

HELLO = Struct(
    "serial_number" / Int32ul,
    "firmware" / Int16ul,
    "channels" / GreedyRange(Struct("channel" / Byte, "kind" / Byte, "orientation" / Byte, "equipment_id" / Byte)),
    Terminated,
)

HEARTBEAT = Struct(
    "channels" / GreedyRange(Struct("channel" / Byte, "received" / Int32ul, "lost" / Int32ul)),
    Terminated,
)

TIME_MARK = Struct("edge_time_ns" / Int64ul, Terminated)

WORDS_429 = Struct("words" / GreedyRange(Struct("offset_ns" / Int32ul, "word" / Int32ul)), Terminated)

WORD_708 = Struct("bit_count" / Int16ul, "data" / Bytes((this.bit_count + 7) // 8), Terminated)


SEQRECORD_429 = Struct(
    "type" / Int16ul,
    "count" / Int16ul,
    "timestamp" / Int32ul,
    "activity" / Int16ul,
    "decoder_gap" / Int16ul,
    "data" / Int32ul,
    "timestamp_high" / Int32ul,
)

SEQRECORD_708 = Struct(
    "type" / Int16ul,
    "count" / Int16ul,
    "timestamp" / Int32ul,
    "activity" / Int16ul,
    "data_count" / Int16ul,
    "data" / Int16ul[100],
    "extra" / Int16ul[16],
    "bit_count" / Int16ul,
    "reserved" / Int16ul,
    "timestamp_high" / Int32ul,
)

MXF_A429 = Struct(
    "time_tag" / Int64ul,
    "control" / Int32ul,
    "repeat_count" / Int32ul,
    "data" / Int32ul,
    "reserved" / Int32ul,
)

MXF_A708 = Struct(
    "time_tag" / Int64ul,
    "control" / Int32ul,
    "data_size" / Int32ul,
    "repeat_count" / Int32ul,
    "manchester_bit_error" / Int32ul,
    "data" / Int16ul[128],
)

RDR4B = Struct("prefix" / Bytes(18), "data" / Bytes(200))


def _lsb_first(width: int) -> "Construct[Any, Any]":
    """An unsigned integer of `width` bits, the least significant sent first."""
    return ExprAdapter(
        Bytes(width),
        lambda bits, _: sum(bit << place for place, bit in enumerate(bits)),
        lambda value, _: bytes(value >> place & 1 for place in range(width)),
    )


# Bit 0 of the radar word is the least significant bit of its first byte, hence the swap.
RADAR_HEADER = BitsSwapped(
    BitStruct(
        "label" / BitsInteger(8),
        "control_accept" / _lsb_first(2),
        "slave" / Flag,
        "spare_11_12" / _lsb_first(2),
        "annunciations" / _lsb_first(5),
        "faults" / _lsb_first(7),
        "stabilised" / Flag,
        "mode" / _lsb_first(3),
        "tilt" / _lsb_first(7),
        "gain" / _lsb_first(6),
        "range" / _lsb_first(6),
        "spare_48" / _lsb_first(1),
        "data_accept" / _lsb_first(2),
        "scan_angle" / _lsb_first(12),
        "spare_63" / _lsb_first(1),
    )
)
