"""What a bridge sends, in plain Python: writes the four packets of docs/racklink.md to standard output."""

import struct
import sys
import zlib
from itertools import count

numbers = count()


def cobs(data: bytes) -> bytes:
    """The bytes without zeros: groups of a code, one more than its length, and up to 254 bytes."""
    sent = b""
    while True:
        group = data[:254].partition(b"\0")[0]
        sent += bytes([len(group) + 1]) + group
        if len(group) == len(data):
            return sent
        data = data[len(group) + (len(group) < 254) :]  # a group shorter than 254 stands for a zero too


def send(kind: int, channel: int, flags: int, time_ns: int, body: bytes) -> None:
    """Write one packet as it goes down the line; `time_ns` is the bridge's own clock."""
    packet = struct.pack("<BBBBIQ", 1, kind, channel, flags, next(numbers) % 2**32, time_ns) + body
    packet += struct.pack("<I", zlib.crc32(packet))
    sys.stdout.buffer.write(cobs(packet) + b"\0")


def main() -> None:
    """A hello, two ARINC 429 words, an ARINC 708 word and a heartbeat."""
    radar = struct.pack("<BBBB", 0, 0x70, 0, 0)  # channel, kind, orientation, low byte of the equipment id
    iru = struct.pack("<BBBB", 1, 0x2A, 0, 4)
    send(0x01, 0, 0, 0, struct.pack("<IH", 0x1234, 0x0102) + radar + iru)
    words = struct.pack("<IIII", 0, 0x600C808B, 360_000, 0xE00190A1)  # ns after the packet's time, word
    send(0x10, 1, 0x01, 1_500_000_000, words)  # two words before them were lost in the bridge
    send(0x20, 0, 0, 1_502_000_000, struct.pack("<H", 1600) + bytes.fromhex("b443047a0e80767c" + 64 * "88c6fa"))
    send(0x02, 0, 0, 2_000_000_000, struct.pack("<BIIBII", 0, 1, 0, 1, 2, 2))  # channel, words sent, words lost


if __name__ == "__main__":
    main()
