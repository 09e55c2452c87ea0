"""CAN frames out of what a CAN adapter records: driver's frames, slcan text or socketcand text.

Only frames with an extended identifier and data come out; all others are counted as skipped, as is what is no frame.
"""

import re
import struct
from collections import Counter
from collections.abc import Iterator
from typing import Final, NamedTuple, Protocol

from decoders import formats as f

RECORD: Final = struct.Struct(f.CAN_RECORD)
LONGEST_LINE: Final = 1 + 8 + 1 + 2 * 64 + 4  # of slcan: command, identifier, length, data, time
LONGEST_TEXT: Final = 200  # of socketcand
SLCAN: Final = re.compile(rb"(T(?=.{8}[0-8])|[DB])([0-9A-Fa-f]{8})([0-9A-Fa-f])((?:[0-9A-Fa-f]{2})*)")
SLCAN_TIME_DIGITS: Final = 4  # which some devices add to a frame
SLCAN_ANSWERS: Final = re.compile(rb"[zZ]?")  # a device says so that it took a command
OTHER_SLCAN: Final = re.compile(rb"[tdbrR][0-9A-Fa-f]*")
SOCKETCAND: Final = re.compile(rb"< frame ([0-9A-Fa-f]{8}) \d+\.\d+ ((?:[0-9A-Fa-f]{2} ?)*) ?>")
OTHER_SOCKETCAND: Final = re.compile(rb"< [a-z]+[^<>]*>")


class Frame(NamedTuple):
    """A frame with an extended identifier of 29 bits, and how many recorded bytes it took."""

    identifier: int
    data: bytes
    size: int


def split(chunk: bytes) -> Iterator[tuple[int, int, int, bytes]]:
    """Arrival in ns of the host's monotonic clock, identifier and FD flags as SocketCAN's, and data of each frame.

    A frame that is not whole ends it.
    """
    at, end, head = 0, len(chunk), RECORD.size
    while at + head <= end:
        arrival_ns, identifier, flags, length = RECORD.unpack_from(chunk, at)
        at += head + length
        if at > end:
            return
        yield arrival_ns, identifier, flags, chunk[at - length : at]


class FrameReader(Protocol):
    """Chunks to frames. Each byte is part of a frame, skipped or kept for the next chunk."""

    skipped: int
    counters: Counter[str]  # of what was skipped, by what it was

    @property
    def pending(self) -> int:
        """Bytes kept for the next chunk."""

    def feed(self, data: bytes) -> list[Frame]:
        """Frames completed by a chunk."""


class Recorded:
    """Frames as a driver gives them: `formats.CAN_RECORD` and the data, again and again; a chunk holds whole ones."""

    pending = 0

    def __init__(self) -> None:
        self.skipped = 0
        self.counters: Counter[str] = Counter()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames of a chunk."""
        frames, rest = [], len(data)
        for _, identifier, _, payload in split(data):
            size = RECORD.size + len(payload)
            rest -= size
            if identifier & 0xE000_0000 == f.CAN_EXTENDED:
                frames.append(Frame(identifier & 0x1FFF_FFFF, payload, size))
            else:
                self.skipped += size
                self.counters["error_frames" if identifier & f.CAN_ERROR else "foreign_frames"] += 1
        self.skipped += rest
        return frames


class Text:
    """Frames as lines of text, whatever the pieces they come in."""

    def __init__(self, end: bytes, longest: int) -> None:
        self.skipped = 0
        self.counters: Counter[str] = Counter()
        self._end = end
        self._longest = longest
        self._line = b""

    @property
    def pending(self) -> int:
        """Bytes of a line without its end."""
        return len(self._line)

    def feed(self, data: bytes) -> list[Frame]:
        """Frames completed by a chunk."""
        *lines, rest = (self._line + data).split(self._end)
        frames = [frame for line in lines if (frame := self._frame(line)) is not None]
        excess = max(len(rest) - self._longest, 0)
        self.skipped += excess
        self._line = rest[excess:]
        return frames

    def _frame(self, line: bytes) -> Frame | None:
        """The frame of a line without its end, or None, and its bytes counted."""
        raise NotImplementedError

    def _skip(self, line: bytes, what: str) -> None:
        self.skipped += len(line) + len(self._end)
        if what:
            self.counters[what] += 1


class Slcan(Text):
    """The text of slcan adapters: T for a classic frame, D or B for an FD one; ends in a carriage return.

    Garbage before a T, which is no hexadecimal digit, does not cost the frame behind it.
    """

    def __init__(self) -> None:
        super().__init__(b"\r", LONGEST_LINE)

    def feed(self, data: bytes) -> list[Frame]:
        """Frames completed by a chunk; an adapter's complaint, a bell, ends a line too."""
        return super().feed(data.replace(b"\a", b"\r"))

    def _frame(self, line: bytes) -> Frame | None:
        start = max(line.rfind(b"T"), 0)
        found = SLCAN.match(line, start)
        if found:
            code = int(found[3], 16)
            length = 2 * (f.CAN_FD_LENGTHS[code] if found[1] != b"T" else code)
            if len(found[4]) in (length, length + SLCAN_TIME_DIGITS) and found.end() == len(line):
                if start:
                    self.skipped += start
                    self.counters["bad_lines"] += 1
                data = bytes.fromhex(found[4][:length].decode())
                return Frame(int(found[2], 16) & 0x1FFF_FFFF, data, len(line) - start + 1)
        if SLCAN_ANSWERS.fullmatch(line):
            self._skip(line, "")
        else:
            self._skip(line, "foreign_frames" if OTHER_SLCAN.fullmatch(line) else "bad_lines")
        return None


class Socketcand(Text):
    """The text of a socketcand server: `< frame 16000010 12.345678 0102030405060708 >`."""

    def __init__(self) -> None:
        super().__init__(b">", LONGEST_TEXT)

    def _frame(self, line: bytes) -> Frame | None:
        whole = line + b">"
        start = max(whole.rfind(b"<"), 0)
        found = SOCKETCAND.fullmatch(whole, start)
        if found:
            if whole[:start].strip():
                self.counters["bad_lines"] += 1
            self.skipped += start
            return Frame(int(found[1], 16) & 0x1FFF_FFFF, bytes.fromhex(found[2].decode()), len(whole) - start)
        self._skip(line, "foreign_frames" if OTHER_SOCKETCAND.fullmatch(whole, start) else "bad_lines")
        return None
