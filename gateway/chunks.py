"""Raw records as columns: of hours of them an object for each takes longer than what is done with it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, groupby, repeat
from operator import length_hint
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gateway.records import Raw, Record, Stamp

COLUMNS: Final = 7
MOST_BYTES: Final = 8 << 20  # of a block, and what a run has more
SEQUENCE, MONOTONIC_NS, UTC_NS, DROPPED_BEFORE, NUMBER, BEGIN, END = range(COLUMNS)


class Chunks:
    """Raw records in order, a column each.

    The rows of `columns` u8 (7, n) are sequence, monotonic_ns, utc_ns, dropped_before, the number of an adapter, whose
    name `adapters` has, and where a chunk begins and ends in `data`.
    """

    def __init__(
        self, columns: NDArray[np.uint64], adapters: Mapping[int, str], data: bytes | NDArray[np.uint8]
    ) -> None:
        self.columns = columns
        self.adapters = adapters
        self.data = data
        self._left: Iterator[int] = iter(())

    @classmethod
    def of(cls, records: Sequence[Raw]) -> Self:
        """Raw records, of which there is at least one, as columns."""
        sequences, stamps, adapters, chunks, dropped = zip(*records, strict=True)
        numbers = {name: number for number, name in enumerate(dict.fromkeys(adapters))}
        ends = [*accumulate(map(len, chunks))]
        own = [numbers[name] for name in adapters]
        rows = sequences, *zip(*stamps, strict=True), dropped, own, [0, *ends[:-1]], ends
        return cls(np.array(rows, np.uint64), {number: name for name, number in numbers.items()}, b"".join(chunks))

    @classmethod
    def joined(cls, parts: Sequence["Chunks"]) -> Self:
        """Chunks behind each other, their bytes too."""
        if not parts:
            return cls(np.empty((COLUMNS, 0), np.uint64), {}, b"")
        columns = np.concatenate([part.columns for part in parts], axis=1)
        size = columns[END] - columns[BEGIN]
        np.cumsum(size, out=columns[END])
        columns[BEGIN] = columns[END] - size
        data, numbers, at, to = np.empty(int(columns[END, -1]), np.uint8), dict[str, int](), 0, 0
        for part in parts:
            own = slice(at, at + len(part))
            for number, name in part.adapters.items():
                columns[NUMBER, own][part.columns[NUMBER] == number] = numbers.setdefault(name, len(numbers))
            copy(np.frombuffer(part.data, np.uint8), part.columns[BEGIN], part.columns[END], data[to:])
            at += len(part)
            to = int(columns[END, at - 1])
        return cls(columns, {number: name for name, number in numbers.items()}, data)

    def part(self, first: int, end: int) -> "Chunks":
        """Those from one up to another."""
        return Chunks(self.columns[:, first:end], self.adapters, self.data)

    def record(self, k: int) -> Raw:
        """One of them as an object."""
        sequence, monotonic_ns, utc_ns, dropped, number, begin, end = self.columns[:, k].tolist()
        return Raw(sequence, Stamp(monotonic_ns, utc_ns), self.adapters[number], bytes(self.data[begin:end]), dropped)

    def stream(self, which: NDArray[np.intp]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """The bytes of some that were joined, one behind the other, and where each of them ends."""
        data, (begins, ends) = np.frombuffer(self.data, np.uint8), self.columns[BEGIN:].astype(np.int64)
        if len(which) == len(self):
            return data[begins[0] : ends[-1]], ends - begins[0]
        begins, ends = begins[which], ends[which]
        behind = np.cumsum(ends - begins)
        out = np.empty(behind[-1], np.uint8)
        copy(data, begins, ends, out)
        return out, behind

    @property
    def size(self) -> int:
        """How many bytes there are."""
        return int((self.columns[END] - self.columns[BEGIN]).sum())

    def __len__(self) -> int:
        """How many there are."""
        return len(self.columns[0])

    def __iter__(self) -> Iterator[Raw]:
        """Each of them as an object."""
        new = tuple.__new__
        sequences, monotonic_ns, utc_ns, dropped, numbers, begins, ends = self.columns.tolist()
        stamps = map(new, repeat(Stamp), zip(monotonic_ns, utc_ns, strict=True))
        adapters = map(self.adapters.__getitem__, numbers)
        chunks = map(bytes, map(self.data.__getitem__, map(slice, begins, ends)))
        self._left = iter(sequences)
        return map(new, repeat(Raw), zip(self._left, stamps, adapters, chunks, dropped, strict=True))

    @property
    def given(self) -> int:
        """How many objects the last iteration has given; all where none has begun."""
        return len(self) - length_hint(self._left)


Run = Chunks | Sequence[Record]


class Block(NamedTuple):
    """Records in order: raw ones as columns, and each other one with how many of those come before it."""

    chunks: Chunks
    others: list[tuple[int, Record]]

    @classmethod
    def of(cls, runs: Iterable[Run]) -> Self:
        """The records of some runs, of which there is at least one."""
        parts, others, before = list[Chunks](), list[tuple[int, Record]](), 0
        for run in runs:
            for some in (run,) if isinstance(run, Chunks) else _pieces(run):
                if isinstance(some, Chunks):
                    parts.append(some)
                    before += len(some)
                else:
                    others.append((before, some))
        return cls(Chunks.joined(parts), others)

    def part(self, first: int, end: int) -> "Block":
        """Raw records from one up to another, and what comes before, between and behind them."""
        others = [(before - first, record) for before, record in self.others if first <= before <= end]
        return Block(self.chunks.part(first, end), others)

    @property
    def first(self) -> Record:
        """The first record."""
        return self.others[0][1] if self.others and not self.others[0][0] else self.chunks.record(0)

    @property
    def last(self) -> Record:
        """The last record."""
        last = len(self.chunks)
        return self.others[-1][1] if self.others and self.others[-1][0] == last else self.chunks.record(last - 1)


def _pieces(records: Iterable[Record]) -> Iterator[Chunks | Record]:
    """Records with the raw ones as columns."""
    for is_raw, some in groupby(records, lambda record: isinstance(record, Raw)):
        if is_raw:
            yield Chunks.of([record for record in some if isinstance(record, Raw)])
        else:
            yield from some


def blocks(runs: Iterable[Run], records: int) -> Iterator[Block]:
    """Runs in blocks of at least so many records, but for the last one and such as are large."""
    held, count, size = list[Run](), 0, 0
    for run in runs:
        held.append(run)
        count += len(run)
        size += run.size if isinstance(run, Chunks) else 0
        if count >= records or size >= MOST_BYTES:
            yield Block.of(held)
            held, count, size = [], 0, 0
    if held:
        yield Block.of(held)


@njit(cache=True)
def copy(data: NDArray[np.uint8], begins: NDArray[Any], ends: NDArray[Any], out: NDArray[np.uint8]) -> None:
    """Copy the pieces data[begins:ends], one behind the other."""
    to = 0
    for k in range(begins.size):
        piece = data[begins[k] : ends[k]]
        place = out[to : to + piece.size]
        for i in range(piece.size):  # assigned as a whole they would be looked at for overlap, which takes longer
            place[i] = piece[i]
        to += piece.size
