"""The compiled CRC-32 is that of zlib, wherever the bytes lie and whatever the processor can do."""

import os
import random
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from decoders.kernels_crc import crc32

LENGTHS = (*range(70), 127, 128, 129, 255, 1000, 4113)


def differences(seed: int) -> list[tuple[int, int]]:
    """Lengths and places of random bytes for which the compiled CRC-32 is another than that of zlib."""
    chosen = random.Random(seed)
    data = chosen.randbytes(max(LENGTHS) + 16)
    array, before = np.frombuffer(data, np.uint8), chosen.getrandbits(32)
    return [
        (length, at)
        for length in LENGTHS
        for at in range(16)
        if crc32(array, at, at + length, before) != zlib.crc32(data[at : at + length], before)
    ]


def test_bytes_of_every_length_at_every_alignment_have_the_crc_of_zlib() -> None:
    assert differences(1) == []


@given(st.binary(max_size=600), st.binary(max_size=600), st.integers(0, 20))
def test_a_crc_goes_on_from_that_of_the_bytes_before(first: bytes, second: bytes, rest: int) -> None:
    data = first + second + bytes(rest)
    array, end = np.frombuffer(data, np.uint8), len(first) + len(second)
    before = crc32(array, 0, len(first), 0)
    assert (before, crc32(array, len(first), end, before)) == (zlib.crc32(first), zlib.crc32(first + second))


def test_a_processor_that_cannot_multiply_without_carries_gives_the_same(tmp_path: Path) -> None:
    plain = {**os.environ, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    asked = "from decoders.kernels_crc import FOLDS; from tests.decoders.test_kernels_crc import differences; "
    asked += "print(FOLDS, differences(2))"
    said = subprocess.run([sys.executable, "-c", asked], env=plain, capture_output=True, text=True, check=True)
    assert said.stdout == "False []\n"
