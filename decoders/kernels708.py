"""The loops over ARINC 708 words, compiled; `decoders.arinc708` says what the codes mean and checks the arguments.

Numba freezes module constants into its cache, so what a profile may change comes as arguments.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from decoders import formats as f
from decoders.results708 import Header, Meanings

Int = int | np.int64
Array = npt.NDArray[Any]
Bytes = npt.NDArray[np.uint8]
Place = tuple[int, int]

HEADER_BYTES: Final = f.HEADER_708_BYTES
LABEL: Final = f.HEADER_708["label"]
CONTROL_ACCEPT: Final = f.HEADER_708["control_accept"]
SLAVE: Final = f.HEADER_708["slave"]
ANNUNCIATIONS: Final = f.HEADER_708["annunciations"]
FAULTS: Final = f.HEADER_708["faults"]
STABILISED: Final = f.HEADER_708["stabilised"]
MODE: Final = f.HEADER_708["mode"]
TILT: Final = f.HEADER_708["tilt"]
GAIN: Final = f.HEADER_708["gain"]
RANGE: Final = f.HEADER_708["range"]
DATA_ACCEPT: Final = f.HEADER_708["data_accept"]
SCAN_ANGLE: Final = f.HEADER_708["scan_angle"]
SPARES: Final = tuple(f.SPARE_708.values())
FIRST_SPARE: Final = f.UNUSUAL_708.index(next(iter(f.SPARE_708)))
RESERVED_LEVEL: Final = 1 << f.UNUSUAL_708.index("reserved_level")
TILT_LSB_DEG: Final = f.TILT_LSB_DEG
SCAN_ANGLE_LSB_DEG: Final = f.SCAN_ANGLE_LSB_DEG
BYTES_AT_ONCE: Final = 12  # of the wire: 32 bins of 3 bits or 16 of 6
LOADED: Final = 16  # bytes for half of them, with some before: one register
WORDS_AT_ONCE: Final = 1024  # headers that stay in the nearest cache while each field passes over them


@njit(cache=True)
def headers(words: Bytes, meanings: Meanings, header: Header) -> None:
    """Fill the header fields of each word. One loop a field: the compiler makes vectors of such loops only."""
    buffer = np.empty(WORDS_AT_ONCE, np.int64)
    for first in range(0, words.shape[0], WORDS_AT_ONCE):
        end = min(first + WORDS_AT_ONCE, words.shape[0])
        bits = buffer[: end - first]
        _load(words[first:end], bits)
        _label(bits, header.label[first:end])
        _code(bits, CONTROL_ACCEPT, header.control_accept[first:end])
        _flag(bits, SLAVE, header.slave[first:end])
        _code(bits, ANNUNCIATIONS, header.annunciations[first:end])
        _code(bits, FAULTS, header.faults[first:end])
        _flag(bits, STABILISED, header.stabilised[first:end])
        _code(bits, MODE, header.mode[first:end])
        _angle(bits, TILT, 0, 1, TILT_LSB_DEG, header.tilt_deg[first:end])
        _look_up(bits, GAIN, meanings.gain_db, header.gain_db[first:end])
        _look_up(bits, RANGE, meanings.range_nm, header.range_nm[first:end])
        _code(bits, DATA_ACCEPT, header.data_accept[first:end])
        zero, sense = meanings.scan_angle_zero, meanings.scan_angle_sense
        _angle(bits, SCAN_ANGLE, zero, sense, SCAN_ANGLE_LSB_DEG, header.scan_angle_deg[first:end])
        _unusual(header.label[first:end], header.mode[first:end], meanings, header.unusual[first:end])
        _spares(bits, header.unusual[first:end])


@njit(cache=True)
def unpack_bins(words: Bytes, bits_per_bin: int, reserved_level: int, bins: Bytes, unusual: Bytes) -> None:
    """Fill the bins of each word, 32 or more of 3 or 6 bits, and flag the words that hold a reserved level."""
    level = np.uint8(reserved_level)
    for i in range(words.shape[0]):
        word, row = words[i], bins[i]
        found = _spread(3, word, row, level) if bits_per_bin == 3 else _spread(6, word, row, level)
        unusual[i] |= found * RESERVED_LEVEL


@njit(cache=True)
def _load(words: Bytes, bits: Array) -> None:
    for i in range(bits.size):
        header = np.int64(0)
        for place in range(HEADER_BYTES):
            header |= np.int64(words[i, place]) << (8 * place)
        bits[i] = header


@njit(cache=True)
def _field(bits: Int, place: Place) -> Int:
    return (bits >> place[0]) & ((1 << place[1]) - 1)


@njit(cache=True)
def _code(bits: Array, place: Place, codes: Array) -> None:
    for i in range(codes.size):
        codes[i] = _field(bits[i], place)


@njit(cache=True)
def _flag(bits: Array, place: Place, flags: Array) -> None:
    for i in range(flags.size):
        flags[i] = _field(bits[i], place) != 0


@njit(cache=True)
def _look_up(bits: Array, place: Place, table: Array, values: Array) -> None:
    for i in range(values.size):
        values[i] = table[_field(bits[i], place)]


@njit(cache=True)
def _angle(bits: Array, place: Place, zero: int, sense: int, lsb_deg: float, values: Array) -> None:
    width = place[1]
    for i in range(values.size):
        code = (zero + sense * _field(bits[i], place)) & ((1 << width) - 1)
        values[i] = np.int32(code - ((code >> (width - 1)) << width)) * lsb_deg  # 32 bits become floats at once


@njit(cache=True)
def _label(bits: Array, labels: Array) -> None:
    # The label alone is sent most significant bit first.
    for i in range(labels.size):
        label = _field(bits[i], LABEL)
        label = (label & 0x0F) << 4 | label >> 4
        label = (label & 0x33) << 2 | (label >> 2) & 0x33
        labels[i] = (label & 0x55) << 1 | (label >> 1) & 0x55


@njit(cache=True)
def _unusual(labels: Array, modes: Array, meanings: Meanings, unusual: Array) -> None:
    for i in range(unusual.size):
        unusual[i] = meanings.unusual_label[labels[i]] | meanings.unusual_mode[modes[i]]


@njit(cache=True)
def _spares(bits: Array, unusual: Array) -> None:
    for i in range(unusual.size):
        for k in range(len(SPARES)):
            unusual[i] |= (_field(bits[i], SPARES[k]) != 0) << (FIRST_SPARE + k)


def _spread_word(_context: Any, width: Any, word: Any, bins: Any, level: Any) -> Any:
    """Bins of `width` bits, 3 or 6, from a word, one a byte; whether any of them is `level`.

    A step takes 12 bytes, as two halves of 6. Each pair of bins lies in two neighbouring bytes and ends in the second:
    shuffle those into a 16-bit lane, shift the pair to its foot, and fill the upper byte from the pair moved up until
    its second bin stands there. The compiler finds no shuffle in a loop, which takes twice as long.
    """
    bits = width.literal_value
    at_once = BYTES_AT_ONCE * 8 // bits
    upper = [(2 * bits * (pair + 1) - 1) // 8 for pair in range(at_once // 2)]  # the byte where each pair ends
    shift = [2 * bits * pair - 8 * (byte - 1) for pair, byte in enumerate(upper)]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source, target = (context.make_array(signature.args[k])(context, builder, arguments[k]) for k in (1, 2))
        length = builder.extract_value(target.shape, 0)
        i8, i16, i32, count = ir.IntType(8), ir.IntType(16), ir.IntType(32), length.type
        loaded, lanes, spread = ir.VectorType(i8, LOADED), ir.VectorType(i16, at_once // 2), ir.VectorType(i8, at_once)
        found = cgutils.alloca_once(builder, spread)  # type: ignore[no-untyped-call] # numba leaves it so
        builder.store(ir.Constant(spread, None), found)
        one = builder.insert_element(ir.Constant(spread, ir.Undefined), arguments[3], i32(0))
        every = _shuffled(builder, one, one, [0] * at_once)
        # Where a byte is in both halves once they are loaded, the first from the start of the word, the other 4 on.
        half = len(upper) // 2
        pick = [byte + k + (HEADER_BYTES if n < half else LOADED + 4) for n, byte in enumerate(upper) for k in (-1, 0)]

        def step(byte: Any, first: Any) -> None:
            start = builder.gep(source.data, [byte])
            places = (start, builder.gep(start, [count(4)]))
            low, high = (builder.load(builder.bitcast(place, loaded.as_pointer()), align=1) for place in places)
            pairs = builder.bitcast(_shuffled(builder, low, high, pick), lanes)
            near = builder.lshr(pairs, ir.Constant(lanes, shift))
            far = builder.shl(near, ir.Constant(lanes, [8 - bits] * len(shift)))
            upper_from_far = [k + at_once * (k % 2) for k in range(at_once)]
            both = _shuffled(builder, builder.bitcast(near, spread), builder.bitcast(far, spread), upper_from_far)
            result = builder.and_(both, ir.Constant(spread, [2**bits - 1] * at_once))
            place = builder.bitcast(builder.gep(target.data, [first]), spread.as_pointer())
            builder.store(result, place, align=1)
            equal = builder.sext(builder.icmp_unsigned("==", result, every), spread)
            builder.store(builder.or_(builder.load(found), equal), found)

        steps = builder.udiv(length, count(at_once))
        with cgutils.for_range(builder, steps) as loop:
            step(builder.mul(loop.index, count(BYTES_AT_ONCE)), builder.mul(loop.index, count(at_once)))
        with builder.if_then(builder.icmp_unsigned("!=", builder.mul(steps, count(at_once)), length)):
            last = builder.sub(length, count(at_once))  # the last ones reach back
            step(builder.udiv(builder.mul(last, count(bits)), count(8)), last)
        whole = builder.bitcast(builder.load(found), ir.IntType(8 * at_once))
        return builder.zext(builder.icmp_unsigned("!=", whole, whole.type(0)), i8)

    return types.uint8(width, word, bins, level), generate


def _shuffled(builder: Any, one: Any, other: Any, pick: list[int]) -> Any:
    """A vector of the elements of two others that `pick` names."""
    return builder.shuffle_vector(one, other, ir.Constant(ir.VectorType(ir.IntType(32), len(pick)), pick))


_spread: Any = intrinsic(prefer_literal=True)(_spread_word)
