"""Faults of the line, on what goes down it: COBS frames, datagrams, CAN frames or lines of text."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import count
from typing import Any

from cobs import cobs
from numpy.random import Generator

from decoders.formats import CAN_FD_LENGTHS, CAN_PREFIX
from simulators import racklink
from simulators.carriers import Frame, Name, Unit
from simulators.faults import Change
from simulators.scenario import LinkFault

LONGEST_GARBAGE = 64
CLASSIC_LENGTHS = CAN_FD_LENGTHS[:9]
Timed = tuple[int, Any]  # when it is ready, and the unit


def _each(change: Callable[[Any, Generator], Sequence[Any]]) -> Change:
    """A fault of single units: `chance` is the share of them for which others go down the line."""

    def fault_of_units(units: Iterator[Timed], fault: LinkFault, rng: Generator) -> Iterator[Timed]:
        for ready_ns, unit in units:
            hit = fault.covers(ready_ns) and rng.random() < fault.chance
            for sent in change(unit, rng) if hit else [unit]:
                yield ready_ns, sent

    return fault_of_units


def _vanish(*_: object) -> list[bytes]:
    return []


def _double(unit: Unit, _: Generator) -> list[Unit]:
    return [unit, unit]


def _flip(unit: Unit, rng: Generator) -> list[Unit]:
    """One bit turned over, on CAN one of the data."""
    data = bytearray(_data(unit))
    if data:
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    return [_with(unit, bytes(data))]


def _truncate(unit: Unit, rng: Generator) -> list[Unit]:
    """The end is missing; a CAN frame has another of the lengths that exist."""
    data = _data(unit)
    lengths = CAN_FD_LENGTHS if isinstance(unit, Frame) else range(len(data))
    shorter = [length for length in lengths if length < len(data)]
    return [_with(unit, data[: rng.choice(shorter)])] if shorter else [unit]


def _spoil_frame(frame: bytes, _: Generator) -> list[bytes]:
    with suppress(cobs.DecodeError):
        return [racklink.framed(_wrong_crc(racklink.unframed(frame)))]
    return [frame]  # another fault was there before


def _spoil_datagram(packet: bytes, _: Generator) -> list[bytes]:
    return [_wrong_crc(packet)]


def _wrong_crc(packet: bytes) -> bytes:
    return packet[:-1] + bytes(byte ^ 0xFF for byte in packet[-1:])


def _stick(data: bytes, _: Generator) -> list[bytes]:
    """As many bytes, and all of them ones."""
    return [b"\xff" * len(data)]


def _stall(units: Iterator[Timed], fault: LinkFault, _: Generator) -> Iterator[Timed]:
    """Nothing comes, and then all of it at once."""
    held: list[Timed] = []
    ready_ns = 0
    for ready_ns, unit in units:  # the last one is needed behind the loop
        if fault.covers(ready_ns):
            held.append((ready_ns, unit))
            continue
        yield from ((round(fault.stop_s * 1e9), late) for _, late in held)
        held.clear()
        yield ready_ns, unit
    yield from ((ready_ns, late) for _, late in held)


def _garbage(units: Iterator[Timed], fault: LinkFault, rng: Generator) -> Iterator[Timed]:
    """Random units `rate_hz` times a second between the others."""
    times_ns = (round((fault.start_s + number / fault.rate_hz) * 1e9) for number in count())
    garbage_ns = next(times_ns)
    for ready_ns, unit in units:
        while garbage_ns <= ready_ns and fault.covers(garbage_ns):
            yield garbage_ns, _random_like(unit, rng)
            garbage_ns = next(times_ns)
        yield ready_ns, unit


def _random_like(unit: Unit, rng: Generator) -> Unit:
    """Random bytes; on CAN a frame of some other device, as one of ours could not be told from the bridge's."""
    if isinstance(unit, Frame):
        length = rng.choice(CAN_FD_LENGTHS if unit.fd else CLASSIC_LENGTHS)
        return Frame(int(rng.integers(CAN_PREFIX << 24)), rng.bytes(int(length)), unit.fd)
    return rng.bytes(int(rng.integers(1, LONGEST_GARBAGE + 1)))


def _data(unit: bytes | Frame) -> bytes:
    return unit.data if isinstance(unit, Frame) else unit


def _with(unit: Unit, data: bytes) -> Unit:
    return unit._replace(data=data) if isinstance(unit, Frame) else data


_ANYWHERE: dict[str, Change] = {
    "cut": _each(_vanish),
    "lost": _each(_vanish),
    "doubled": _each(_double),
    "bit_flips": _each(_flip),
    "truncated": _each(_truncate),
    "stall": _stall,
    "garbage": _garbage,
}
# Which faults exist on which line. CAN frames have no CRC of ours, and on a CAN bus or in a network a line that stands
# still gives nothing at all rather than bytes of ones.
FAULTS: dict[Name, dict[str, Change]] = {
    "stream": _ANYWHERE | {"wrong_crc": _each(_spoil_frame), "stuck": _each(_stick)},
    "datagram": _ANYWHERE | {"wrong_crc": _each(_spoil_datagram)},
    "can": _ANYWHERE,
    "slcan": _ANYWHERE | {"stuck": _each(_stick)},
}
