"""The range bins of ARINC 708 words, cut out many at a time; `decoders.arinc708` checks the arguments."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from decoders import formats as f

Bytes = npt.NDArray[np.uint8]

HEADER_BYTES: Final = f.HEADER_708_BYTES
BINS: Final = f.BINS_708
RESERVED_LEVEL: Final = f.UNUSUAL_708.index("reserved_level")
BYTES_AT_ONCE: Final = 12  # of the wire: 32 bins of 3 bits or 16 of 6
HALF: Final = BYTES_AT_ONCE // 2
LOADED: Final = 16  # bytes for one half, with some before


@njit(cache=True)
def unpack_bins(words: Bytes, bits_per_bin: int, reserved_level: int, bins: Bytes, unusual: Bytes) -> None:
    """Fill the bins of each word, 32 or more of 3 or 6 bits, and flag the words that hold a reserved level.

    From the last bin to the first: the system clears a large piece of fresh memory from its beginning, so its end is
    still in the caches, and beyond them this takes two thirds of the time.
    """
    level = np.uint8(reserved_level)
    count = bins.shape[1]
    for i in range(words.shape[0] - 1, -1, -1):
        word, row = words[i], bins[i]
        if bits_per_bin == 3 and count == BINS:  # the standard's own: a count known when compiled is faster
            found = _spread(3, BINS, word, row, level)
        elif bits_per_bin == 3:
            found = _spread(3, count, word, row, level)
        else:
            found = _spread(6, count, word, row, level)
        unusual[i] |= found << RESERVED_LEVEL


@njit(cache=True, error_model="numpy")
def mean_step(bins: Bytes, apart: int) -> float:
    """How much bins (n, M) differ on the mean from those so many bins farther on the same radial; NaN without such."""
    total = 0
    for i in range(bins.shape[0]):
        near, far = bins[i, :-apart], bins[i, apart:]
        for j in range(far.size):
            total += int(abs(np.int16(far[j]) - np.int16(near[j])))
    return float(total / (bins.shape[0] * (bins.shape[1] - apart)))


def _spread_word(_context: Any, width: Any, _length: Any, word: Any, bins: Any, level: Any) -> Any:
    """`_length` bins of `width` bits, 3 or 6, from a word, one a byte; whether any of them is `level`.

    A step takes 12 bytes, as two halves of 6. Each pair of bins lies in two neighbouring bytes or in one: shuffle those
    into a 16-bit lane, shift the pair to its foot, and fill the upper byte from the pair moved up until its second bin
    stands there. The compiler finds no shuffle in a loop, which takes twice as long.
    """
    bits = width.literal_value
    at_once = BYTES_AT_ONCE * 8 // bits
    shift, lane_bytes = _lanes(bits, at_once)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source, target = (context.make_array(signature.args[k])(context, builder, arguments[k]) for k in (2, 3))
        i8, i16, i32, count = ir.IntType(8), ir.IntType(16), ir.IntType(32), arguments[1].type
        half, lanes, spread = ir.VectorType(i8, LOADED), ir.VectorType(i16, at_once // 2), ir.VectorType(i8, at_once)
        found = cgutils.alloca_once(builder, spread)  # type: ignore[no-untyped-call] # numba leaves it so
        builder.store(ir.Constant(spread, None), found)
        one = builder.insert_element(ir.Constant(spread, ir.Undefined), arguments[4], i32(0))
        every = _shuffled(builder, one, one, [0] * at_once)

        def load(byte: Any, kind: Any) -> Any:
            place = builder.gep(source.data, [byte])
            return builder.load(builder.bitcast(place, kind.as_pointer()), align=1)

        def whole(step: Any) -> Any:
            # The processor shuffles within each half of a register only, so the halves of a step must meet in its
            # middle: what is loaded begins before the step and ends after it, and stays in the word but at its ends.
            before = at_once // 2 - HALF
            loaded = load(builder.add(builder.mul(step, count(BYTES_AT_ONCE)), count(HEADER_BYTES - before)), spread)
            return _shuffled(builder, loaded, loaded, [byte + before for byte in lane_bytes])

        def halves(byte: Any) -> Any:
            # Slower, and in the word everywhere: the first half with the 8 bytes before it, the second with 10.
            first, second = load(byte, half), load(builder.add(byte, count(4)), half)
            pick = [byte + HEADER_BYTES if byte < HALF else byte + 4 + LOADED for byte in lane_bytes]
            return _shuffled(builder, first, second, pick)

        def spread_out(loaded: Any, first_bin: Any) -> None:
            near = builder.lshr(builder.bitcast(loaded, lanes), ir.Constant(lanes, shift))
            far = builder.shl(near, ir.Constant(lanes, [8 - bits] * len(shift)))
            upper_from_far = [k + at_once * (k % 2) for k in range(at_once)]
            both = _shuffled(builder, builder.bitcast(near, spread), builder.bitcast(far, spread), upper_from_far)
            result = builder.and_(both, ir.Constant(spread, [2**bits - 1] * at_once))
            place = builder.bitcast(builder.gep(target.data, [first_bin]), spread.as_pointer())
            builder.store(result, place, align=1)
            equal = builder.sext(builder.icmp_unsigned("==", result, every), spread)
            builder.store(builder.or_(builder.load(found), equal), found)

        length, steps = arguments[1], builder.udiv(arguments[1], count(at_once))
        last = builder.sub(steps, count(1))
        with builder.if_then(builder.icmp_unsigned("!=", builder.mul(steps, count(at_once)), length)):
            rest = builder.sub(length, count(at_once))  # more than what no whole step takes
            spread_out(halves(builder.udiv(builder.mul(rest, count(bits)), count(8))), rest)
        spread_out(halves(builder.mul(last, count(BYTES_AT_ONCE))), builder.mul(last, count(at_once)))
        with cgutils.for_range(builder, last, start=count(1)) as loop:
            step = builder.sub(last, loop.index)
            spread_out(whole(step), builder.mul(step, count(at_once)))
        spread_out(halves(count(0)), count(0))
        any_found = builder.bitcast(builder.load(found), ir.IntType(8 * at_once))
        return builder.zext(builder.icmp_unsigned("!=", any_found, any_found.type(0)), i8)

    return types.uint8(width, types.int64, word, bins, level), generate


def _lanes(bits: int, at_once: int) -> tuple[list[int], list[int]]:
    """Of each lane, how far its pair of bins is from its foot; of each two, the bytes of a step that they come from."""
    first_bit = [2 * bits * pair for pair in range(at_once // 2)]
    last_byte = [(bit + 2 * bits - 1) // 8 for bit in first_bit]
    shift = [bit - 8 * (byte - 1) for bit, byte in zip(first_bit, last_byte, strict=True)]
    return shift, [byte for bit, last in zip(first_bit, last_byte, strict=True) for byte in (bit // 8, last)]


def _shuffled(builder: Any, one: Any, other: Any, pick: list[int]) -> Any:
    """A vector of the elements of two others that `pick` names."""
    return builder.shuffle_vector(one, other, ir.Constant(ir.VectorType(ir.IntType(32), len(pick)), pick))


_spread: Any = intrinsic(prefer_literal=True)(_spread_word)
