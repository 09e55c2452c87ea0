"""One bridge as the gateway knows it: its channels, its packet counter, its losses."""

from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429, control708
from decoders import formats as f
from decoders.definitions import Definitions, for_equipment, load_definitions
from decoders.framing import Packet, PacketFramer, Packets
from decoders.health429 import EQUIPMENT, BusHealth
from decoders.profiles import Profile
from decoders.racklink import ChannelCount, Hello, words429
from gateway.books import Books
from gateway.channels import Channel429, Channel708
from gateway.config import AdapterConfig, definitions_of, profile_of
from gateway.framing import form_of
from gateway.recent import RECENT, Recent
from monitor.utc import TIME, UTC_LABELS

SEQUENCE_RANGE = 1 << 32
GOES_BACK_NS = 1_000_000_000  # more than any order of packets
FLAG_NAMES = {
    f.FLAG_FIFO_OVERFLOW: "fifo_overflow",
    f.FLAG_PARITY: "parity_error",
    f.FLAG_CODING: "coding_error",
    f.FLAG_WORD_LENGTH: "word_length_error",
    f.FLAG_SYNC: "sync_error",
}
SPOILT = f.FLAG_CODING | f.FLAG_WORD_LENGTH | f.FLAG_SYNC  # words whose bits cannot be trusted


@dataclass
class Link:
    """State of one bridge, kept over reconnections."""

    config: AdapterConfig
    radar_profile: Profile
    framer: PacketFramer = field(init=False)
    counters: Counter[str] = field(default_factory=Counter)
    losses: Counter[str] = field(default_factory=Counter)  # since the last verdict
    channels: dict[int, Channel429 | Channel708] = field(default_factory=dict)
    books: defaultdict[int, Books] = field(default_factory=lambda: defaultdict(Books))  # by channel
    _recent: Recent = field(default_factory=Recent)
    next_sequence: int = -1  # of the packet that is to come; none has come yet
    latest_ns: int = 0  # of the bridge's clock
    _clock_went_back: bool = False  # since the last heartbeat
    _said: dict[int, int] = field(default_factory=dict)  # by channel, its equipment as its last label 377 said

    def __post_init__(self) -> None:
        form = form_of(self.config)
        self.framer, self._unit, self.advice = form.framer(), form.unit, form.advice
        self._checked = form.checked
        for number, channel in self.config.channels.items():
            if channel.kind == "arinc708":
                self.channels[number] = Channel708(
                    profile_of(channel.profile) if channel.profile else self.radar_profile
                )
            elif channel.definitions:
                definitions = definitions_of(channel.definitions)
                self.channels[number] = self._read_by(number, definitions, channel.orientation, f.KIND_429_HIGH)

    def succeed(self, before: "Link") -> None:
        """Take over the channels and counters of a link whose pipeline failed; bytes half framed are lost with it."""
        self.channels, self.counters, self.losses = before.channels, before.counters, before.losses
        self.books = before.books
        self.framer.succeed(before.framer)

    def announced(self, hello: Hello) -> dict[int, Channel429 | Channel708]:
        """The channels that are other ones than so far, as the bridge says; what the configuration says goes first.

        A bridge says the same again every few seconds, and the health of its buses goes on.
        """
        found: dict[int, Channel429 | Channel708] = {}
        for said in hello.channels:
            configured = self.config.channels.get(said.channel)
            if configured and (configured.kind == "arinc708" or configured.definitions):
                continue
            if said.kind == f.KIND_708 and not configured:
                found[said.channel] = Channel708(self.radar_profile)
            elif said.kind in (f.KIND_429_LOW, f.KIND_429_HIGH) and said.orientation < len(f.ORIENTATIONS):
                name = for_equipment(said.equipment_id)
                if name is None:
                    self.counters["channels_of_unknown_equipment"] += 1
                else:
                    orientation = configured.orientation if configured else f.ORIENTATIONS[said.orientation]
                    found[said.channel] = self._read_by(said.channel, load_definitions(name), orientation, said.kind)
            else:
                self.counters["channels_of_unknown_kind"] += 1
        return {number: channel for number, channel in found.items() if self.channels.get(number) != channel}

    def identify(self, packet: Packet) -> str | None:
        """Take a channel that nobody announced by its own equipment label (377); return the set it is read by now.

        Label 377 is the same in both orientations. Two normal words must say the same before they are believed.
        """
        number = packet.channel
        if number in self.channels or packet.type != f.WORDS_429 or packet.flags & SPOILT:
            return None
        parts = arinc429.unpack(words429(packet).words)
        said = parts.data[(parts.label == EQUIPMENT) & parts.parity_ok & (parts.ssm == 0)] & 0xFFF
        for equipment in said.tolist():
            name = for_equipment(equipment & 0xFF)
            if name and self._said.get(number) == equipment:
                configured = self.config.channels.get(number)
                orientation = configured.orientation if configured else "wire"
                self.channels[number] = self._read_by(number, load_definitions(name), orientation, f.KIND_429_HIGH)
                return name
            self._said[number] = equipment
        return None

    def _read_by(self, number: int, definitions: Definitions, orientation: str, kind: int) -> Channel429:
        """The channel if it is read in this way, the one that it is if it was before."""
        before = self.channels.get(number)
        if isinstance(before, Channel429) and before.reads(definitions, orientation, kind):
            return before
        configured = self.config.channels.get(number)
        delays_ns = np.zeros(256, np.int64)
        for label, delay_ms in configured.delays_ms.items() if configured else ():
            delays_ns[int(label, 8)] = round(delay_ms * 1e6)
        for row in definitions.labels.values():  # a remainder is as old as what it belongs to
            if row.fine_of is not None:
                delays_ns[row.label] = delays_ns[row.fine_of]
        if TIME in definitions.labels and definitions.labels[TIME].encoding == "time":
            delays_ns[[*UTC_LABELS]] = delays_ns[TIME]
        return Channel429(
            definitions,
            BusHealth(definitions, orientation, kind),
            kind,
            control708.is_panel(definitions),
            orientation,
            configured.join_rule if configured else "concatenate",
            configured.sdi if configured else None,
            delays_ns,
        )

    def count(self, packet: Packet) -> bool:
        """Count the packet, the flags it carries, and the packets missing before it; whether it is a new one.

        The very same packet once more, as a network may deliver it, is counted and must not be used again. One that
        others have overtaken is not lost after all.
        """
        if packet.sequence != self.next_sequence and packet in self._recent:
            self.counters["packets_repeated"] += 1
            return False
        self._recent.append(packet)
        self.counters["packets"] += 1
        if packet.type in (f.WORDS_429, f.WORD_708):
            self._clock_went_back |= self._checked and packet.time_ns < self.latest_ns - GOES_BACK_NS
            self.latest_ns = packet.time_ns
        if packet.flags:
            self._count_flags(packet.flags)
        if self.next_sequence >= 0:
            gap = (packet.sequence - self.next_sequence) % SEQUENCE_RANGE
            if gap < SEQUENCE_RANGE // 2:
                self.counters["packets_lost"] += gap
                self.losses["packets lost"] += gap
            elif gap >= SEQUENCE_RANGE - RECENT and packet.time_ns < max(other.time_ns for other in self._recent):
                self.counters["packets_late"] += 1
                self.counters["packets_lost"] -= 1
                return True
            else:
                self.counters["sequence_restarts"] += 1
                for books in self.books.values():
                    books.restart()
        self.next_sequence = (packet.sequence + 1) % SEQUENCE_RANGE
        return True

    def count_plain(self, packets: Packets, own: NDArray[np.intp], latest_ns: int) -> None:
        """Count those packets that are this bridge's, which follow the one before and each other.

        `latest_ns` is the device time of the last words.
        """
        self.counters["packets"] += len(own)
        self.losses["packets lost"] += 0  # losses are told in the order in which they were counted first
        self._recent.extend(packets, own[-RECENT:].tolist())
        self.next_sequence = (int(packets.header["sequence"][own[-1]]) + 1) % SEQUENCE_RANGE
        self.latest_ns = latest_ns

    def _count_flags(self, flags: int) -> None:
        for bit, name in FLAG_NAMES.items():
            if flags & bit:
                self.counters[name] += 1
        if flags & f.FLAG_FIFO_OVERFLOW:
            self.losses["overflows in the bridge"] += 1

    def radar(self, number: int) -> Channel708 | None:
        """The channel if it is a radar's. Where no bridge can announce one, a radar word does it."""
        if number not in self.channels and not self.framer.announces:
            self.channels[number] = Channel708(self.radar_profile)
        channel = self.channels.get(number)
        return channel if isinstance(channel, Channel708) else None

    def heartbeat(self, counts: tuple[ChannelCount, ...]) -> dict[str, int]:
        """Take what the bridge says that it sent and that it lost itself; what is newly lost, by where."""
        before = self._words_lost()
        for count in counts:
            self.books[count.channel].say(count, self._clock_went_back)
        self._clock_went_back = False
        new = {what: max(lost - before[what], 0) for what, lost in self._words_lost().items()}
        self.losses.update(new)
        return {what: count for what, count in new.items() if count}

    def dropped(self, count: int) -> None:
        """Count bytes, frames or datagrams that the gateway or its kernel had no room for."""
        self.counters[f"{self._unit}_dropped"] += count
        self.losses[f"{self._unit} dropped"] += count

    def take_losses(self) -> list[str]:
        """What was lost since the last call, in words."""
        lost = [f"degraded: {self.config.name}: {count} {what}" for what, count in self.losses.items() if count]
        self.losses.clear()
        return lost

    def all_counters(self) -> dict[str, int]:
        """Every counter of this bridge by name."""
        peaks = {
            f"channel_{number}.peak_words_per_s": round(channel.health.peak_words_per_s)
            for number, channel in self.channels.items()
            if isinstance(channel, Channel429)
        }
        words = {
            f"channel_{number}.{name}": count
            for number, books in self.books.items()
            for name, count in books.counters().items()
        }
        lost = {what.replace(" ", "_").replace("_the_", "_"): count for what, count in self._words_lost().items()}
        dropped = {f"{self._unit}_dropped": 0}
        return {**self.framer.counters(), **dropped, **self.counters, **lost, **words, **peaks}

    def _words_lost(self) -> dict[str, int]:
        """Words lost on all channels, by where."""
        return {
            "words lost in the bridge": sum(books.lost_in_bridge for books in self.books.values()),
            "words lost on the link": sum(books.lost_on_link for books in self.books.values()),
        }
