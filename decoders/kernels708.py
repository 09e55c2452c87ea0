"""The loops over ARINC 708 words, compiled; `decoders.arinc708` says what the codes mean and checks the arguments.

Numba freezes module constants into its cache, so what a profile may change comes as arguments.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import njit, types
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
BYTES_AT_ONCE: Final = 24  # of the wire: 64 bins of 3 bits or 32 of 6
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
        for k in range(len(SPARES)):
            _spare(bits, SPARES[k], FIRST_SPARE + k, header.unusual[first:end])


@njit(cache=True)
def unpack_bins(words: Bytes, bits_per_bin: int, reserved_level: int, bins: Bytes, unusual: Bytes) -> None:
    """Fill the bins of each word, 64 or more of 3 or 6 bits, and flag the words that hold a reserved level."""
    level = np.uint8(reserved_level)
    at_once = BYTES_AT_ONCE * 8 // bits_per_bin
    for i in range(words.shape[0]):
        found = np.uint64(0)
        for start in range(0, bins.shape[1], at_once):
            first = min(start, bins.shape[1] - at_once)  # the last ones reach back
            byte = HEADER_BYTES + first * bits_per_bin // 8
            if bits_per_bin == 3:
                found |= _spread(3, words[i], byte, bins[i], first, level)
            else:
                found |= _spread(6, words[i], byte, bins[i], first, level)
        unusual[i] |= (found != 0) * RESERVED_LEVEL


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
        values[i] = (code - ((code >> (width - 1)) << width)) * lsb_deg


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
def _spare(bits: Array, place: Place, flag: int, unusual: Array) -> None:
    for i in range(unusual.size):
        unusual[i] |= (_field(bits[i], place) != 0) << flag


def _spread_24(_context: Any, width: Any, word: Any, byte: Any, bins: Any, first: Any, level: Any) -> Any:
    """Bins of `width` bits, 3 or 6, from 24 bytes at word[byte:] to bins[first:], one a byte; a bit for each `level`.

    Each pair of bins lies in two neighbouring bytes: shuffle those into a 16-bit lane, shift the pair to its foot, and
    move its upper half to the upper byte. The compiler finds no shuffle in a loop, which takes twice as long.
    """
    bits = width.literal_value
    count = BYTES_AT_ONCE * 8 // bits
    before = HEADER_BYTES  # loaded too: with them it is one register, and they are there before the first bin

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source, target = (context.make_array(signature.args[k])(context, builder, arguments[k]).data for k in (1, 3))
        i8, i16, i32, i64 = (ir.IntType(size) for size in (8, 16, 32, 64))
        packed, lanes = ir.VectorType(i8, before + BYTES_AT_ONCE), ir.VectorType(i16, count // 2)
        spread, indices = ir.VectorType(i8, count), ir.VectorType(i32, count)

        def constant(*lane_values: int) -> Any:
            return ir.Constant(lanes, lane_values * (count // 2 // len(lane_values)))

        pairs = [divmod(2 * bits * pair, 8) for pair in range(count // 2)]  # byte and bit where each begins
        pick = [before + min(at + k, BYTES_AT_ONCE - 1) for at, _ in pairs for k in (0, 1)]
        start = builder.sub(arguments[2], ir.Constant(arguments[2].type, before))
        place = builder.bitcast(builder.gep(source, [start]), packed.as_pointer())
        loaded = builder.load(place, align=1)
        pair = builder.bitcast(builder.shuffle_vector(loaded, loaded, ir.Constant(indices, pick)), lanes)
        pair = builder.lshr(pair, constant(*(bit for _, bit in pairs)))
        near = builder.and_(pair, constant(2**bits - 1))
        far = builder.and_(builder.shl(pair, constant(8 - bits)), constant((2**bits - 1) << 8))
        result = builder.bitcast(builder.or_(near, far), spread)
        place = builder.bitcast(builder.gep(target, [arguments[4]]), spread.as_pointer())
        builder.store(result, place, align=1)
        one = builder.insert_element(ir.Constant(spread, ir.Undefined), arguments[5], i32(0))
        every = builder.shuffle_vector(one, one, ir.Constant(indices, None))
        found = builder.bitcast(builder.icmp_unsigned("==", result, every), ir.IntType(count))
        return builder.zext(found, i64) if count < i64.width else found

    return types.uint64(width, word, byte, bins, first, level), generate


_spread: Any = intrinsic(prefer_literal=True)(_spread_24)
