"""The books of one bridge, to the word: what its buses carried, and what of that never left the bridge."""

import struct
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field

from cobs import cobs

from simulators import racklink

Line = tuple[int, int]  # channel, packet type


@dataclass
class Ledger:
    """Words by channel and packet type (`WORDS_429`, `WORD_708`), as far as the traffic has been made.

    A heartbeat says `received`, the words that the bridge put or meant to put on the link since it started, and `lost`,
    those lost inside the bridge before the link. So of any channel

        words on the bus = received + lost, and words on the bus = arrived + lost on the link + lost in the bridge

    and each heartbeat that arrives makes the gateway's count of losses exact again.
    """

    carried: Counter[Line] = field(default_factory=Counter)
    lost: Counter[Line] = field(default_factory=Counter)
    overflowed: set[int] = field(default_factory=set)  # channels whose next packet of words must say so

    def carry(self, channel: int, kind: int, words: int) -> None:
        """The bus of the channel has carried so many words."""
        if words:
            self.carried[channel, kind] += words

    def lose(self, channel: int, kind: int, words: int) -> None:
        """So many of the words carried are lost inside the bridge."""
        if words:
            self.lost[channel, kind] += words
            self.overflowed.add(channel)

    def lose_frame(self, frame: bytes) -> None:
        """A packet that the bridge had numbered and framed already is lost inside it.

        The words of one that another fault had spoilt before were lost on the link, and are counted there.
        """
        with suppress(cobs.DecodeError, struct.error):
            packed = racklink.unframed(frame)
            packet = racklink.unpacked(packed)
            if racklink.packed(packet) == packed:
                self.lose(packet.channel, packet.type, packet.words)

    def counts(self, channel: int) -> tuple[int, int]:
        """Words received and words lost, as a heartbeat says them."""
        carried, lost = (
            sum(words for (number, _), words in book.items() if number == channel) for book in (self.carried, self.lost)
        )
        return carried - lost, lost
