"""The lines of `dump`: every word, what it means, and what the bridge said against it."""

import numpy as np

from decoders import formats as f
from gateway.config import check_config
from gateway.text import lines
from simulators import arinc429, arinc708
from tests.gateway.made import GNSS, Bridge, raw

RACK = check_config({"adapters": [{"name": "bridge", "source": "serial:x"}]}, "test")
LATITUDE = int(arinc429.encode_position(0o110, 0o120, [44.4])[0][0])  # label 110


def dumped(*packets: bytes) -> list[str]:
    """The lines without time and adapter."""
    found = list(lines([raw(1, 0.0, b"".join(packets))], RACK))
    return [line.split("bridge", 1)[1] for line in found]


def test_a_word_on_a_channel_that_nobody_announced_is_shown_undecoded() -> None:
    assert dumped(Bridge().words(9, 0.0, [LATITUDE])) == [f"   9  429  {LATITUDE:08x}  channel without definitions"]


def test_the_flags_of_the_bridge_stand_behind_every_word_of_their_packet() -> None:
    bridge = Bridge()
    found = dumped(bridge.hello(), bridge.words(GNSS, 0.0, [LATITUDE, LATITUDE], f.FLAG_PARITY))
    assert len(found) == 2
    assert all("GNSS latitude: 44.39" in line and line.endswith(" deg  parity_error") for line in found)


def test_words_whose_bits_cannot_be_trusted_are_shown_and_not_decoded() -> None:
    bridge, word = Bridge(), arinc708.encode(np.zeros(512), scan_angle_deg=0.0, tilt_deg=0.0, range_nm=10.0)
    flags = f.FLAG_CODING | f.FLAG_FIFO_OVERFLOW
    label, radar = dumped(bridge.hello(), bridge.words(GNSS, 0.0, [LATITUDE], flags), bridge.radar(0.0, word, flags))
    assert label.endswith(f"{LATITUDE:08x}  not decoded  fifo_overflow  coding_error")
    assert radar.endswith("1600 bits, not decoded  fifo_overflow  coding_error")
