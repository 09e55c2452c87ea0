"""A file as a window that moves forward in large blocks, and where its index begins."""

import os
import re
import struct
import zlib
from pathlib import Path
from types import TracebackType
from typing import Self

from gateway.errors import GatewayError
from gateway.recording.layout import MAGIC

BLOCK = 1 << 19  # with what is made of it, it stays in a core's cache
MOST_INDEX = 4 << 20  # of a channel or two for every adapter there could be
_FOOTER = struct.Struct("<BQQQI8s")  # opcode, length, where the summary begins, and its offsets, CRC-32, magic
_FOOTER_OPCODE, _FOOTER_LENGTH = 2, 20
_DATA_END = b"\x0f\x04" + bytes(11)  # opcode, length, and no CRC-32 of the data


class Window:
    """Bytes of a file: `data` begins at `base` and moves forward; nothing behind `end` is seen.

    `closed` says whether the file has a sound `index`; `end` is then the end of the data before it. Raises
    GatewayError for a file that cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.base = 0
        self.data = b""
        self.index = b""
        self._path = path
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise GatewayError(f"cannot read recording {path}: {error.strerror}") from error
        try:
            self.size = os.fstat(self._file).st_size
            start = self._index_start()
            ends_with_magic = self.read(max(self.size - len(MAGIC), 0), len(MAGIC)) == MAGIC
        except BaseException:
            os.close(self._file)
            raise
        self.closed = start is not None
        self.ends_with_magic = ends_with_magic
        self.end = self.size if start is None else start

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)

    def get(self, at: int, count: int) -> bytes:
        """Bytes from an offset on that does not lie before earlier ones; fewer at the end."""
        self._have(at, at + count)
        return self.data[at - self.base : at - self.base + count]

    def find(self, pattern: re.Pattern[bytes], at: int, longest: int) -> int | None:
        """Where a pattern of up to `longest` bytes is met first from an offset on."""
        while at < self.end:
            self._have(at, at + longest)
            if found := pattern.search(self.data, at - self.base):
                return self.base + found.start()
            seen = self.base + len(self.data)
            at = self.end if seen == self.end else max(at, seen - longest) + 1
        return None

    def _have(self, at: int, end: int) -> None:
        end = min(end, self.end)
        have = self.base + len(self.data)
        if end > have:
            more = self.read(have, min(max(end - have, BLOCK), self.end - have))
            self.data = self.data[at - self.base :] + more
            self.base = at
            if have + len(more) < end:  # the file has become shorter
                self.end = have + len(more)

    def read(self, at: int, count: int) -> bytes:
        """Bytes from anywhere, without moving; fewer at the end of the file."""
        try:
            return os.pread(self._file, count, at)
        except OSError as error:
            what = f"cannot read recording {self._path} at byte {at}: {error.strerror}"
            raise GatewayError(f"{what}; copy what its disk still gives, with ddrescue, and read the copy") from error

    def _index_start(self) -> int | None:
        """Where the data ends before an index whose CRC-32 is right; that of the footer covers all but the magic."""
        begin = self.size - _FOOTER.size
        if begin < 0:
            return None
        opcode, length, start, _, crc, magic = _FOOTER.unpack(self.read(begin, _FOOTER.size))
        if (opcode, length, magic) != (_FOOTER_OPCODE, _FOOTER_LENGTH, MAGIC) or not 0 < self.size - start < MOST_INDEX:
            return None
        section = self.read(start, self.size - start)
        if zlib.crc32(section[: -len(MAGIC) - 4]) != crc:
            return None
        self.index = section
        begin = int(start)
        ended = begin >= len(_DATA_END) and self.read(begin - len(_DATA_END), len(_DATA_END)) == _DATA_END
        return begin - len(_DATA_END) if ended else begin
