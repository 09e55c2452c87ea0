"""Pieces of imported files to the records of a recording: stamps, chunks, ticks and notes."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import count

from gateway.imports import Piece
from gateway.records import Note, Raw, Record, Stamp, Status, Tick

SECOND_NS = 1_000_000_000
ANEW_NS = SECOND_NS  # a time that steps back by more is of a clock that began anew, as to the pipeline
LONGEST_PAUSE_NS = 86_400 * SECOND_NS  # and so is one that leaps ahead by more
LATEST_NS = 1 << 62
CHUNK_BYTES = 1 << 16
CHUNK_NS = 10_000_000  # what one chunk gathers
SHARED_NS = 1_000_000  # and where files are laid beside each other by their stamps, as no chunk is in time but its end
PAUSE_TICKS_NS = 10 * SECOND_NS  # so long ticks go on in a pause; then nothing has changed for them to tell


class Clock:
    """Time since the first piece, from the file's own times; it never goes back.

    Times that step back a little are counted and wait until time has caught up. Where the file's clock begins anew,
    time goes on from where it was: how long the pause was, nobody knows.
    """

    def __init__(self) -> None:
        self.elapsed_ns = 0
        self.steps_back = self.begun_anew = 0
        self._here_ns = 0
        self._last_ns: int | None = None

    def advance(self, time_ns: int | None) -> None:
        """Take the time of the next piece."""
        if time_ns is None:
            return
        step_ns = 0 if self._last_ns is None else time_ns - self._last_ns
        self._last_ns = time_ns
        if not -ANEW_NS <= step_ns <= LONGEST_PAUSE_NS or self._here_ns + step_ns > LATEST_NS:
            self.begun_anew += 1
            self._here_ns, step_ns = self.elapsed_ns, 0
        self.steps_back += step_ns < 0
        self._here_ns += step_ns
        self.elapsed_ns = max(self.elapsed_ns, self._here_ns)


class Records:
    """Makes records of pieces. Each adapter's bytes of a short while are one chunk with the time of its last piece.

    A piece behind a pause, or the first of all, is a chunk of its own: its stamp is then its own time, so that the
    clock of the adapter is laid beside the others without a delay.
    """

    def __init__(
        self, adapters: Sequence[str], start_utc_ns: int, *, stamped: bool = False, chunk_ns: int = CHUNK_NS
    ) -> None:
        """`stamped` pieces have their stamp, a u64 of monotonic ns, put before them, as CAN frames are recorded."""
        self.clock = Clock()
        self._adapters = adapters
        self._start_utc_ns = start_utc_ns
        self._stamped = stamped
        self._longest_ns = chunk_ns
        self._number = count()
        self._chunks: dict[str, bytearray] = {}
        self._last_ns: dict[str, int] = {}  # of each adapter's pieces
        self._chunk_ns = 0  # when the oldest of them began
        self._tick_ns = SECOND_NS  # of the next tick

    def made(self, pieces: Iterable[Piece], opening: Iterable[str]) -> Iterator[Record]:
        """Notes of `opening`, every piece, and a tick each second."""
        yield from map(self.note, opening)
        yield from (self._status(name, "UP") for name in self._adapters)
        for piece in pieces:
            before_ns = self.clock.elapsed_ns
            self.clock.advance(piece.time_ns)
            yield from self._until(before_ns, self.clock.elapsed_ns)
            yield from self._take(piece)
        yield from self._flush()
        yield from (self._status(name, "CLOSED") for name in self._adapters)

    def note(self, text: str) -> Note:
        """A note of now."""
        return Note(next(self._number), self._stamp(self.clock.elapsed_ns), text)

    def _until(self, before_ns: int, now_ns: int) -> Iterator[Record]:
        """What is due before a piece: chunks that are long enough, and ticks."""
        if now_ns - self._chunk_ns > self._longest_ns or now_ns >= self._tick_ns:
            yield from self._flush()
        while self._tick_ns <= now_ns:
            if self._tick_ns > before_ns + PAUSE_TICKS_NS:
                self._tick_ns = (now_ns // SECOND_NS + 1) * SECOND_NS
                return
            yield Tick(next(self._number), self._stamp(self._tick_ns))
            self._tick_ns += SECOND_NS

    def _take(self, piece: Piece) -> Iterator[Record]:
        now_ns = self.clock.elapsed_ns
        if piece.data:
            if not self._chunks:
                self._chunk_ns = now_ns
            before_ns = self._last_ns.get(piece.adapter)
            resumes = before_ns is None or now_ns - before_ns > self._longest_ns
            self._last_ns[piece.adapter] = now_ns
            chunk = self._chunks.setdefault(piece.adapter, bytearray())
            chunk += (now_ns.to_bytes(8, "little") if self._stamped else b"") + piece.data
            if resumes or len(chunk) >= CHUNK_BYTES:
                yield from self._flush()
        if piece.note:
            yield from self._flush()
            yield self.note(piece.note)
        if piece.ends:
            yield from self._flush()

    def _flush(self) -> Iterator[Record]:
        for adapter in sorted(self._chunks, key=self._last_ns.__getitem__):
            yield Raw(next(self._number), self._stamp(self._last_ns[adapter]), adapter, bytes(self._chunks[adapter]))
        self._chunks.clear()

    def _status(self, adapter: str, state: str) -> Status:
        return Status(next(self._number), self._stamp(self.clock.elapsed_ns), adapter, state, "imported")

    def _stamp(self, elapsed_ns: int) -> Stamp:
        return Stamp(elapsed_ns, self._start_utc_ns + elapsed_ns)
