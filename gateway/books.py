"""The words of a channel: what arrived, and what its bridge says of the rest."""

from dataclasses import dataclass, field

from decoders.racklink import ChannelCount

COUNT_RANGE = 1 << 32
LARGEST_LEAP = 1 << 24  # words from a heartbeat to the next: twenty minutes of a full rack


@dataclass
class Count:
    """A count in a bridge's heartbeats, of 32 bits, followed over its wraps.

    A heartbeat continues that one of the two before it from which it is nearer ahead. So a single wrong one, as a line
    without a checksum may give it, is put right by the next.
    """

    value: int = 0
    _before: list[tuple[int, int]] = field(default_factory=list)  # said, and the value then

    @property
    def begun(self) -> bool:
        """Whether there was a heartbeat."""
        return bool(self._before)

    def goes_back(self, said: int) -> bool:
        """Whether a heartbeat says less than the one before it."""
        return bool(self._before) and (said - self._before[-1][0]) % COUNT_RANGE >= LARGEST_LEAP

    def begin(self, said: int, value: int) -> None:
        """What is said now stands for this value."""
        self.value = value
        self._before = [(said, value)]

    def say(self, said: int, anew: int) -> None:
        """Take what the next heartbeat says; the value is `anew` if it continues none."""
        nearest = LARGEST_LEAP, 0
        for earlier, value in self._before:
            nearest = min(nearest, ((said - earlier) % COUNT_RANGE, value))
        more, value = nearest
        self.value = value + more if more < LARGEST_LEAP else anew
        self._before = [*self._before[-1:], (said, self.value)]


@dataclass
class Books:
    """Words of one channel. Listening may begin at any time: what was before the first heartbeat counts as sent."""

    arrived: int = 0
    lost_on_link: int = 0
    _expected: Count = field(default_factory=Count)  # to have arrived if the link loses nothing
    _lost_in_bridge: Count = field(default_factory=Count)
    _until_restart: int | None = None  # what had arrived or was known to be lost when the bridge began anew

    @property
    def lost_in_bridge(self) -> int:
        """Words that never left the bridge."""
        return self._lost_in_bridge.value

    def restart(self) -> None:
        """The bridge has begun anew and counts from zero. What it lost since its last heartbeat is unknown."""
        if self._expected.begun:
            self._until_restart = self.arrived + self.lost_on_link

    def say(self, count: ChannelCount, clock_went_back: bool = False) -> None:
        """Take a heartbeat's counts."""
        if self._until_restart is None and clock_went_back and self._expected.goes_back(count.received):
            self._until_restart = self._expected.value
        if self._until_restart is not None:
            self._expected.begin(count.received, self._until_restart + count.received)
            self._lost_in_bridge.begin(count.lost, self.lost_in_bridge + count.lost)
            self._until_restart = None
        else:
            self._expected.say(count.received, self.arrived + self.lost_on_link)
            self._lost_in_bridge.say(count.lost, self.lost_in_bridge)
        self.lost_on_link = max(self._expected.value - self.arrived, 0)

    def counters(self) -> dict[str, int]:
        """Every counter by name."""
        return {
            "words": self.arrived,
            "words_lost_on_link": self.lost_on_link,
            "words_lost_in_bridge": self.lost_in_bridge,
        }
