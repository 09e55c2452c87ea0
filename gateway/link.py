"""One bridge as the gateway knows it: its channels, its packet counter, its losses."""

from collections import Counter
from dataclasses import dataclass, field
from typing import ClassVar

from decoders import formats as f
from decoders.definitions import Definitions, for_equipment, load_definitions
from decoders.profiles import Profile
from decoders.racklink import ChannelCount, Framer, Hello, Packet
from gateway.config import AdapterConfig, definitions_of, profile_of

SEQUENCE_RANGE = 1 << 32
FLAG_NAMES = {
    f.FLAG_FIFO_OVERFLOW: "fifo_overflow",
    f.FLAG_PARITY: "parity_error",
    f.FLAG_CODING: "coding_error",
    f.FLAG_WORD_LENGTH: "word_length_error",
    f.FLAG_SYNC: "sync_error",
}
SPOILT = f.FLAG_CODING | f.FLAG_WORD_LENGTH | f.FLAG_SYNC  # words whose bits cannot be trusted


@dataclass(frozen=True)
class Channel429:
    """An ARINC 429 channel: the equipment on it and how to read its labels."""

    equipment: int
    definitions: Definitions
    orientation: str

    packet_type: ClassVar[int] = f.WORDS_429

    @property
    def role(self) -> str:
        """What only one channel can be at a time."""
        return f"source of equipment {self.equipment:02X}"


@dataclass(frozen=True)
class Channel708:
    """An ARINC 708 channel."""

    profile: Profile
    packet_type: ClassVar[int] = f.WORD_708
    role: ClassVar[str] = "radar"


@dataclass
class Link:
    """State of one bridge, kept over reconnections."""

    config: AdapterConfig
    radar_profile: Profile
    framer: Framer = field(default_factory=Framer)
    counters: Counter[str] = field(default_factory=Counter)
    losses: Counter[str] = field(default_factory=Counter)  # since the last verdict
    channels: dict[int, Channel429 | Channel708] = field(default_factory=dict)
    _next_sequence: int | None = None
    _lost: dict[int, int] = field(default_factory=dict)  # by channel, as the last heartbeat said

    def __post_init__(self) -> None:
        for number, channel in self.config.channels.items():
            if channel.kind == "arinc708":
                self.channels[number] = Channel708(
                    profile_of(channel.profile) if channel.profile else self.radar_profile
                )
            elif channel.definitions:
                definitions = definitions_of(channel.definitions)
                self.channels[number] = Channel429(definitions.equipment_id & 0xFF, definitions, channel.orientation)

    def succeed(self, before: "Link") -> None:
        """Take over the channels and counters of a link whose pipeline failed; bytes half framed are lost with it."""
        self.channels, self.counters, self.losses = before.channels, before.counters, before.losses
        self.framer.succeed(before.framer)

    def hello(self, hello: Hello) -> None:
        """Take what the bridge says of its channels; what the configuration says goes first."""
        for said in hello.channels:
            configured = self.config.channels.get(said.channel)
            if configured and (configured.kind == "arinc708" or configured.definitions):
                continue
            if said.kind == f.KIND_708 and not configured:
                self.channels[said.channel] = Channel708(self.radar_profile)
            elif said.kind in (f.KIND_429_LOW, f.KIND_429_HIGH) and said.orientation < len(f.ORIENTATIONS):
                name = for_equipment(said.equipment_id)
                if name is None:
                    self.counters["channels_of_unknown_equipment"] += 1
                else:
                    orientation = configured.orientation if configured else f.ORIENTATIONS[said.orientation]
                    self.channels[said.channel] = Channel429(said.equipment_id, load_definitions(name), orientation)
            else:
                self.counters["channels_of_unknown_kind"] += 1

    def count(self, packet: Packet) -> None:
        """Count the packet, the flags it carries, and the packets missing before it."""
        self.counters["packets"] += 1
        for bit, name in FLAG_NAMES.items():
            if packet.flags & bit:
                self.counters[name] += 1
        if packet.flags & f.FLAG_FIFO_OVERFLOW:
            self.losses["overflows in the bridge"] += 1
        if self._next_sequence is not None:
            gap = (packet.sequence - self._next_sequence) % SEQUENCE_RANGE
            if gap < SEQUENCE_RANGE // 2:
                self.counters["packets_lost"] += gap
                self.losses["packets lost"] += gap
            else:
                self.counters["sequence_restarts"] += 1
        self._next_sequence = (packet.sequence + 1) % SEQUENCE_RANGE

    def heartbeat(self, counts: tuple[ChannelCount, ...]) -> None:
        """Take what the bridge says it lost itself, and count what is new of it."""
        lost = sum((count.lost - self._lost.get(count.channel, count.lost)) % SEQUENCE_RANGE for count in counts)
        self._lost |= {count.channel: count.lost for count in counts}
        self.counters["words_lost_in_bridge"] += lost
        self.losses["words lost in the bridge"] += lost

    def dropped(self, count: int) -> None:
        """Count bytes that the gateway had no room for."""
        self.counters["bytes_dropped"] += count
        self.losses["bytes dropped"] += count

    def take_losses(self) -> list[str]:
        """What was lost since the last call, in words."""
        lost = [f"degraded: {self.config.name}: {count} {what}" for what, count in self.losses.items() if count]
        self.losses.clear()
        return lost

    def all_counters(self) -> dict[str, int]:
        """Every counter of this bridge by name."""
        return {**self.framer.counters(), **self.counters}
