"""The test vectors that bridge makers read decode as the page says."""

import re
from pathlib import Path

from decoders.racklink import ChannelCount, Framer, HelloChannel, Packet, heartbeat, hello, words429

PAGE = Path(__file__).parents[2] / "docs" / "racklink.md"


def vector(name: str) -> Packet:
    block = re.search(rf"```{name}\n(.+?)\n```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    (packet,) = Framer().feed(bytes.fromhex(block.group(1)))
    return packet


def test_the_hello_names_the_bridge_and_its_channels() -> None:
    said = hello(vector("hello"))
    assert (said.serial_number, said.firmware) == (0x1234, 0x0102)
    assert said.channels == (HelloChannel(0, 0x70, 0, 0), HelloChannel(1, 0x2A, 0, 4))


def test_the_heartbeat_counts_words() -> None:
    packet = vector("heartbeat")
    assert (packet.sequence, packet.time_ns) == (1, 1_000_000_000)
    assert heartbeat(packet) == (ChannelCount(0, 80, 0), ChannelCount(1, 400, 2))


def test_the_words_come_with_their_times() -> None:
    packet = vector("words")
    block = words429(packet)
    assert (packet.channel, packet.sequence) == (1, 2)
    assert block.words.tolist() == [0x600C808B, 0xE00190A1]
    assert block.time_ns.tolist() == [1_500_000_000, 1_500_360_000]
