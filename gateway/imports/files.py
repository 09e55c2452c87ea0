"""Files of interface cards, cut where their records end."""

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from decoders.vendor_records import RecordFramer
from gateway.errors import GatewayError
from gateway.imports import Piece
from gateway.names import shown

BLOCK_BYTES = 1 << 20


class Source:
    """A file to be read once: when that is done, `told` says of which bytes the recording was made."""

    def __init__(self, path: Path) -> None:
        """Raises GatewayError for what is no file, or an empty one."""
        self.path = path
        self.size = 0
        self._digest = hashlib.sha256()
        try:
            found = path.stat()
        except OSError as error:
            raise GatewayError(f"cannot read {path}: {error.strerror}") from error
        if not path.is_file():
            raise GatewayError(f"{path} is not a file: write the data to one, and import that")
        if not found.st_size:
            raise GatewayError(f"{path} is empty: look for another copy")

    def blocks(self) -> Iterator[bytes]:
        """The bytes of the file, up to 1 MiB at a time. Raises GatewayError if it cannot be read."""
        try:
            with self.path.open("rb") as file:
                while block := file.read(BLOCK_BYTES):
                    self.size += len(block)
                    self._digest.update(block)
                    yield block
        except OSError as error:
            raise GatewayError(f"cannot read {self.path}: {error.strerror}") from error

    @property
    def told(self) -> str:
        """Name, size and checksum of what was read."""
        return f"imported {shown(self.path.name)}: {self.size} bytes, SHA-256 {self._digest.hexdigest()}"


def cut(sources: Iterable[Source], adapter: str, framer: RecordFramer) -> Iterator[Piece]:
    """The records of files that follow one another, each a piece, and every byte between and behind them."""
    number = 0
    time_ns: int | None = None
    for source in sources:
        rest = b""
        for block, last in _with_last(source.blocks()):
            data, at = rest + block, 0
            for span in framer.spans(data, number, whole=last):
                number += 1
                time_ns = time_ns if span.time_ns is None else span.time_ns
                yield Piece(time_ns, adapter, data[at : at + span.size])
                at += span.size
            rest = data[at:]
        yield Piece(time_ns, adapter, rest, ends=True)  # a torn record may be left


def _with_last(blocks: Iterable[bytes]) -> Iterator[tuple[bytes, bool]]:
    """Each block, and whether it is the last."""
    before: bytes | None = None
    for block in blocks:
        if before is not None:
            yield before, False
        before = block
    if before is not None:
        yield before, True
