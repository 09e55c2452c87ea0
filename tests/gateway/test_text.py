"""The lines of `dump`: every word, what it means, and what the bridge said against it."""

import numpy as np

from decoders import formats as f
from gateway.config import check_config
from gateway.text import lines
from simulators import arinc429, arinc708, racklink
from tests.gateway.made import GNSS, RADAR, Bridge, raw

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


def test_a_radar_word_of_another_length_is_shown_with_its_bits_and_its_header() -> None:
    bridge, word = Bridge(), arinc708.encode(np.zeros(512), scan_angle_deg=90.0, tilt_deg=-3.25, range_nm=40.0)
    short = bridge.packet(f.WORD_708, RADAR, 0, racklink.word_708(word[:50], 397), f.FLAG_WORD_LENGTH)
    long = bridge.packet(f.WORD_708, RADAR, 0, racklink.word_708(word + b"\0", 1601))
    stump = bridge.packet(f.WORD_708, RADAR, 0, racklink.word_708(word[:8], 63))
    found = dumped(bridge.hello(), short, long, stump)
    header = f"{word[:8].hex()}...  angle  +90.000  tilt  -3.25   40 NM  mode 2"
    assert found[0].endswith(f"{header}  397 bits, bins not decoded  word_length_error")
    assert found[1].endswith(f"{header}  1601 bits, bins not decoded")
    assert found[2].endswith(f"{word[:8].hex()}...  63 bits, not decoded")


def test_what_is_unusual_in_a_radar_word_stands_behind_it() -> None:
    bridge = Bridge()
    bins = np.where(np.arange(512) == 3, 5, 0)
    word = arinc708.encode(bins, scan_angle_deg=0.0, tilt_deg=0.0, range_nm=10.0, label=0o060)
    (line,) = dumped(bridge.hello(), bridge.radar(0.0, word))
    assert line.endswith("1 of 512 bins lit  unknown_label  reserved_level")
