"""The numbers of the formats: what decoders and encoders may share without sharing code that packs or unpacks."""

from typing import Final

# --- RackLink 1: packets of a bridge ----------------------------------------------------------------------------------
LINK_VERSION: Final = 1
LINK_HEADER: Final = "<BBBBIQ"  # version, type, channel, flags, sequence, time_ns; struct notation
LINK_HEADER_BYTES: Final = 16
LINK_CRC_BYTES: Final = 4  # CRC-32 of IEEE 802.3, little-endian, over header and body
LINK_MAX_BYTES: Final = 4096  # of a packet before COBS
LINK_MAX_ENCODED_BYTES: Final = 4113  # COBS adds one byte to each begun group of 254; the closing 0x00 not counted
LINK_MAX_WORDS: Final = 256  # ARINC 429 words of one packet
ENTRY_429_BYTES: Final = 8  # each with its offset from the packet's time, ns u4, and the word u4

HELLO: Final = 0x01
HEARTBEAT: Final = 0x02
TIME_MARK: Final = 0x03
WORDS_429: Final = 0x10
WORD_708: Final = 0x20

COUNTS: Final = "<BII"  # of a heartbeat, for each channel: its number, words received, words lost; struct notation

FLAG_FIFO_OVERFLOW: Final = 0x01
FLAG_PARITY: Final = 0x02
FLAG_CODING: Final = 0x04
FLAG_WORD_LENGTH: Final = 0x08
FLAG_SYNC: Final = 0x10

KIND_429_LOW: Final = 0x29
KIND_429_HIGH: Final = 0x2A
KIND_708: Final = 0x70

ORIENTATIONS: Final = ("wire", "label_swapped")  # of a 429 label; the index is the code in a hello

# --- RackLink 1 over CAN: extended identifiers, from the highest bit 5 bits prefix, 8 channel, 4 kind, 12 index -------
CAN_PREFIX: Final = 0b10110
CAN_WORD_429: Final = 0  # index: the low byte of the word
CAN_WORD_708: Final = 1  # index: number of the segment, from 0
CAN_HEARTBEAT: Final = 2  # index 0
CAN_429: Final = "<II"  # word, device time in us, its low 32 bits; struct notation
CAN_COUNTS: Final = "<II"  # words received, words lost
CAN_708_HEAD: Final = "<QHB"  # time_ns, bit count, flags; the word's bytes follow
CAN_SEGMENT_BYTES: Final = {"classic": 7, "fd": 63}  # of head and word in a frame, behind the word counter (u8)
CAN_FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)  # a last segment is padded up to one of them

# --- Recorded chunks of devices that give messages instead of a stream: for each message this head, and its bytes -----
DATAGRAM_RECORD: Final = "<QH"  # monotonic host time of arrival in ns, length; struct notation
CAN_RECORD: Final = "<QIBB"  # that time, identifier with SocketCAN's flags, SocketCAN's FD flags, length
CAN_EXTENDED: Final = 0x8000_0000  # SocketCAN's flags of an identifier
CAN_REMOTE: Final = 0x4000_0000
CAN_ERROR: Final = 0x2000_0000

# --- ARINC 429 --------------------------------------------------------------------------------------------------------
LOW_SPEED_BIT_NS: Final = 80_000  # 12.5 kbit/s
HIGH_SPEED_BIT_NS: Final = 10_000  # 100 kbit/s
WORD_429_BIT_TIMES: Final = 36  # 32 bits and the shortest gap of 4

# What SSM 00, 01, 10 and 11 say. In "bcd" 00 is plus (N, E, right, to) and 11 is minus (S, W, left, from).
SSM_TABLES: Final = {
    "bnr": ("FAILURE_WARNING", "NO_COMPUTED_DATA", "FUNCTIONAL_TEST", "NORMAL"),
    "bcd": ("NORMAL", "NO_COMPUTED_DATA", "FUNCTIONAL_TEST", "NORMAL"),
    "disc": ("NORMAL", "NO_COMPUTED_DATA", "FUNCTIONAL_TEST", "FAILURE_WARNING"),
}
SSM_BCD_MINUS: Final = 3

# Label 150, UTC: name -> first bit, width, largest value. Second 60 is a leap second, at 23:59 alone.
TIME_FIELDS: Final = {"hours": (24, 5, 23), "minutes": (18, 6, 59), "seconds": (12, 6, 60)}
# Label 125, UTC in tenths of a minute: BCD digit -> first bit, width.
CLOCK_DIGITS: Final = {
    "hour_tens": (27, 2),
    "hour_units": (23, 4),
    "minute_tens": (19, 4),
    "minute_units": (15, 4),
    "minute_tenths": (11, 4),
}
# Label 260, date: BCD digit -> first bit, width. The year is modulo 100, read as 2000 to 2099.
DATE_DIGITS: Final = {
    "day_tens": (28, 2),
    "day_units": (24, 4),
    "month_tens": (23, 1),
    "month_units": (19, 4),
    "year_tens": (15, 4),
    "year_units": (11, 4),
}

# --- ARINC 708 --------------------------------------------------------------------------------------------------------
WORD_708_BITS: Final = 1600
WORD_708_BYTES: Final = 200
HEADER_708_BYTES: Final = 8
WORD_708_US: Final = 1606  # 1600 bits at 1 Mbit/s and two syncs of 3 us
LONGEST_WORD_708_BITS: Final = 2047  # that receiving cards take
LABEL_708: Final = 0o055

# Header field -> first bit (bit 0 is the first on the wire), width. Only the label is sent most significant bit first.
HEADER_708: Final = {
    "label": (0, 8),
    "control_accept": (8, 2),
    "slave": (10, 1),
    "annunciations": (13, 5),
    "faults": (18, 7),
    "stabilised": (25, 1),
    "mode": (26, 3),
    "tilt": (29, 7),
    "gain": (36, 6),
    "range": (42, 6),
    "data_accept": (49, 2),
    "scan_angle": (51, 12),
}
# Bits without a meaning, as in HEADER_708.
SPARE_708: Final = {"spare_11_12": (11, 2), "spare_48": (48, 1), "spare_63": (63, 1)}
# What a radial can have that its profile does not expect, the first name the lowest bit of `unusual`.
UNUSUAL_708: Final = ("unknown_label", "reserved_mode", *SPARE_708, "reserved_level")
ANNUNCIATIONS_708: Final = ("turbulence_alert", "weather_alert", "anti_clutter", "sector_scan", "beyond_limits")
MODES_708: Final = {
    "standby": 0,
    "weather": 1,
    "map": 2,
    "contour": 3,
    "test": 4,
    "turbulence": 5,
    "weather_turbulence": 6,
    "reserved": 7,
}
TILT_LSB_DEG: Final = 0.25
GAIN_LSB_DB: Final = -1.0  # code 0 is maximum gain
GAIN_CALIBRATED: Final = 63
RANGE_LSB_NM: Final = 5
RANGE_CODE_ZERO_NM: Final = 320
SCAN_ANGLE_LSB_DEG: Final = 360 / 4096
BINS_708: Final = 512
BITS_PER_BIN_708: Final = 3
