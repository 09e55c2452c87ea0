"""Words made for the tests straight from the standards' pictures of a word, one bit at a time, without the kernels."""

import numpy as np
import numpy.typing as npt
from cobs import cobs

# What makes a word of ARINC 708 unusual.
LABEL, MODE, SPARE_11, SPARE_48, SPARE_63, RESERVED_LEVEL = (1 << bit for bit in range(6))
PAYLOAD_708 = bytes.fromhex("88c6fa") * 64  # the levels 0 to 7, 64 times
NORMAL_SSM = {"bnr": 3, "bcd": 0, "disc": 0}


def word429(label: int, fields: dict[int, tuple[int, int]], ssm: int = 0, odd: bool = True) -> int:
    """Fields are first bit -> (value, width), bit 1 the first on the wire; bit 32 makes the parity odd, or even."""
    bits = {9 - place: int(digit) for place, digit in enumerate(reversed(f"{label:08b}"), 1)}
    for first, (value, width) in {**fields, 30: (ssm, 2)}.items():
        for place in range(width):
            bits[first + place] = value >> place & 1
    bits[32] = (sum(bits.values()) + odd) % 2
    return sum(bit << (number - 1) for number, bit in bits.items())


def header708(**fields: int) -> bytes:
    """Header fields by code; bits 0-7 label (most significant first), the rest least significant first."""
    places = {
        "control_accept": (8, 2), "slave": (10, 1), "spare_11": (11, 2), "annunciations": (13, 5), "faults": (18, 7),
        "stabilised": (25, 1), "mode": (26, 3), "tilt": (29, 7), "gain": (36, 6), "range": (42, 6), "spare_48": (48, 1),
        "data_accept": (49, 2), "scan_angle": (51, 12), "spare_63": (63, 1),
    }  # fmt: skip
    bits = [int(digit) for digit in f"{fields.pop('label', 0o055):08b}"] + [0] * 56
    for name, code in fields.items():
        first, width = places[name]
        for place in range(width):
            bits[first + place] = code >> place & 1
    return bytes(sum(bits[8 * byte + place] << place for place in range(8)) for byte in range(8))


def words708(*headers: bytes, payload: bytes = PAYLOAD_708) -> npt.NDArray[np.uint8]:
    """One word (200 bytes) for each header, all with the same bins."""
    return np.frombuffer(b"".join(header + payload for header in headers), np.uint8).reshape(-1, 200)


def frame(packet: bytes) -> bytes:
    return bytes(cobs.encode(packet)) + b"\0"
