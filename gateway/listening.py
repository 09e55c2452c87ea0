"""From recorded chunks to words that wait: framing, losses, which channels are used, who is heard, and whose time.

Nothing is decoded here but what says what a channel is. Whoever makes a `Listener` gives `read`, which takes what
waits and is called before anything changes how words are to be read, and `read_sweep`, which takes the radials and is
called as soon as one may end its sweep.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from decoders import formats as f
from decoders.racklink import ENTRY_429, MalformedBody, Packet, heartbeat, hello, joined429, radar_word
from gateway.channels import Channel429, Channel708
from gateway.chunks import DROPPED_BEFORE, MONOTONIC_NS, NUMBER, Chunks
from gateway.config import RackConfig, profile_of
from gateway.hearing import QUIET_NS, RADAR, Hearing
from gateway.link import SPOILT, Link
from gateway.plain import CAREFUL, CHANNELS, LATEST_DEVICE_NS, NEVER_NS, Batch, Laid, Ways, framed, take_plain
from gateway.records import Raw
from gateway.telling import Telling
from gateway.timebase import Timebase
from gateway.waiting import LONGEST_WAIT_NS, MOST_RADIALS, WAIT_NS, WaitingRadials, WaitingWords
from monitor.quantities import are_distinct

Place = tuple[str, int]  # adapter and channel
WORTH_WHILE = 4  # packets: fewer are taken sooner one by one
LATEST_HOST_NS = np.uint64(np.iinfo(np.int64).max)
MOST_HEARTBEATS = 16  # taken at once


class Listener:
    """The bridges of a rack. `now_ns` is the common time of the latest word, `now_host_ns` when that was read."""

    def __init__(
        self,
        config: RackConfig,
        telling: Telling,
        read: Callable[[], None],
        read_sweep: Callable[[], None],
        began_anew: Callable[[str, int], None],
        *,
        patient: bool = False,
    ) -> None:
        profile = profile_of(config.radar_profile)
        self.links = {a.name: Link(a, profile) for a in config.adapters}
        self.hearing = Hearing({name: link.advice for name, link in self.links.items()})
        self.timebase = Timebase([*self.links])
        self._numbers = {name: number for number, name in enumerate(self.links)}
        self.words: dict[Place, WaitingWords] = {}
        self.radials = WaitingRadials()
        self.chunks_of_unknown_adapter = 0
        self.now_ns = 0
        self.now_host_ns: int | None = None
        self._telling = telling
        self._read = read
        self._read_sweep = read_sweep
        self._began_anew = began_anew
        # The height of the geoid is looked up at the newest position, so words that need it must be read by the second.
        self._patient = patient and config.monitor.height_source == "076"
        self._users: dict[str, tuple[Place, int]] = {}  # by role, and when last heard
        self._unused: dict[Place, str] = {}  # why a channel is not used, told already

    def succeed(self, before: "Listener") -> None:
        """Take over what was known of the channels, and count what the one before leaves unread."""
        self.chunks_of_unknown_adapter = before.chunks_of_unknown_adapter
        for name, link in self.links.items():
            link.succeed(before.links[name])
        for (adapter, _), waiting in before.words.items():
            self.links[adapter].counters["words_429_unused"] += len(waiting)
        if before.radials.link:
            self.links[before.radials.link.config.name].counters["words_708_unused"] += len(before.radials)

    @property
    def patient(self) -> bool:
        """Whether words may wait for the end of a scan, because nobody asks for the state before.

        Where two channels give the same quantity it matters which of them was read first.
        """
        equipment = (
            channel.definitions.equipment_id & 0xFF
            for link in self.links.values()
            for channel in link.channels.values()
            if isinstance(channel, Channel429)
        )
        return self._patient and are_distinct(tuple(equipment))

    def take(self, record: Raw) -> None:
        """Take a chunk."""
        link = self.links.get(record.adapter)
        if link is None:
            self.chunks_of_unknown_adapter += 1
            return
        link.counters["chunks"] += 1
        if record.dropped_before:
            link.dropped(record.dropped_before)
        self.hearing.bytes_came(record.adapter, record.stamp.monotonic_ns)
        for packet in link.framer.feed(record.data):
            self._packet(link, packet, record)

    def alone(self, chunks: Chunks) -> list[int]:
        """The chunks that must be taken one by one.

        What was dropped before a chunk is owned up to by the next verdict, and not by one before.
        """
        dropped, monotonic_ns = chunks.columns[DROPPED_BEFORE], chunks.columns[MONOTONIC_NS]
        unusual = (self._link_of(chunks) < 0) | (dropped > 0) | (monotonic_ns > LATEST_HOST_NS)
        return np.flatnonzero(unusual).tolist()

    def _link_of(self, chunks: Chunks) -> NDArray[np.int64]:
        """Which of the links each chunk came from, -1 for an adapter that is not known."""
        found = [self._numbers.get(chunks.adapters[number], -1) for number in range(len(chunks.adapters))]
        of: NDArray[np.int64] = np.array(found, np.int64)[chunks.columns[NUMBER].astype(np.intp)]
        return of

    def framed(self, chunks: Chunks) -> Batch:
        """The packets that chunks complete of which none must be taken alone; for `take_all`."""
        return framed([*self.links.values()], self._link_of(chunks), chunks)

    def take_all(self, chunks: Chunks, batch: Batch) -> None:
        """Take chunks and their packets: the same as one by one, and sooner."""
        numbers, monotonic_ns = self._link_of(chunks), chunks.columns[MONOTONIC_NS]
        for number, (name, link) in enumerate(self.links.items()):
            own = np.flatnonzero(numbers == number)
            if len(own):
                link.counters["chunks"] += len(own)
                self.hearing.bytes_came(name, int(monotonic_ns[own[-1]]))
        links = [*self.links.values()]
        at, end = 0, len(batch.link)
        while at < end:
            if end - at >= WORTH_WHILE:
                at += self._take_plain(links, chunks, batch.rest(at))
            if at < end:
                record = chunks.record(batch.record[at])
                self._telling.begin(record)
                self._packet(links[batch.link[at]], batch.packets.packet(at), record)
                at += 1
        self._telling.begin(chunks.record(len(chunks) - 1))

    def _take_plain(self, links: Sequence[Link], chunks: Chunks, batch: Batch) -> int:
        """Take the packets in front of which there is nothing to say; how many these are."""
        ways, radials = self._ways(), self.radials
        newest = np.empty(len(ways.channels), np.int64)
        arrived = np.empty((MOST_HEARTBEATS + 1, len(newest) + 1), np.int64)
        awake = np.array([not self.hearing.is_quiet(name) for name in self.links])
        sequence, latest_ns = np.array(
            [[link.next_sequence for link in links], [link.latest_ns for link in links]], np.int64
        )
        bits = radials.channel.profile.word_bits if radials.channel else 0
        header, start, size, _, data = batch.packets
        count, beats, now_ns, laid = take_plain(
            header, start, size, data, batch.link, batch.host_ns, *ways[1:], awake, sequence, latest_ns,
            self.timebase.clocks, self.timebase.reference, radials.watch.last, bits, MOST_RADIALS - 1 - len(radials),
            self._longest_wait_ns, newest, arrived,
        )  # fmt: skip
        if not count:
            return 0
        for number, link in enumerate(links):
            own = np.flatnonzero(batch.link[:count] == number)
            if len(own):
                link.count_plain(batch.packets, own, int(latest_ns[number]))
                self.hearing.heard(link.config.name, int(batch.host_ns[own[-1]]))
        for beat in arrived[:beats].tolist():
            self._count_words(ways, beat[1:])
            self._telling.begin(chunks.record(batch.record[beat[0]]))
            self._heartbeat(links[batch.link[beat[0]]], batch.packets.packet(beat[0]))
        self._count_words(ways, arrived[beats, 1:].tolist())
        if len(newest) and (latest := newest.max()) >= 0:
            self.now_ns, self.now_host_ns = int(now_ns), int(batch.host_ns[latest])
            self._put(ways, newest.tolist(), batch, Laid(*laid))
        return int(count)

    def _ways(self) -> Ways:
        """How the packets of each channel may be taken now."""
        channels: list[tuple[Link, int, Channel429 | Channel708]] = []
        waits: list[tuple[int, int]] = []
        slot = np.full((len(self.links), CHANNELS), CAREFUL, np.int16)
        for role, ((name, number), _) in self._users.items():
            link, quiet = self.links[name], self.hearing.is_quiet
            what = link.channels.get(number)
            if what is None or what.role != role:
                continue
            if isinstance(what, Channel708):
                if self.radials.link is not link or self.radials.channel is not what or quiet(RADAR):
                    continue
            elif what.is_panel or quiet(f"{name}/{number}"):
                continue
            slot[self._numbers[name], number] = len(channels)
            channels.append((link, number, what))
            waiting = self.words.get((name, number))
            waits.append((waiting.end_ns, waiting.until_ns) if waiting and waiting.until_ns else (0, NEVER_NS))
        end_ns, until_ns = np.array(waits, np.int64).reshape(-1, 2).T.copy()
        is_radar = np.array([isinstance(what, Channel708) for _, _, what in channels], np.bool_)
        return Ways(channels, slot, is_radar, end_ns, until_ns)

    def _count_words(self, ways: Ways, arrived: Sequence[int]) -> None:
        """Count words of plain packets, by slot."""
        for (link, number, channel), words in zip(ways.channels, arrived, strict=True):
            if words:
                link.counters["words_429" if isinstance(channel, Channel429) else "words_708"] += words
                link.books[number].arrived += words

    def _put(self, ways: Ways, newest: Sequence[int], batch: Batch, laid: Laid) -> None:
        """Let the words of plain packets wait, by slot the newest of which is told."""
        for slot, ((link, number, channel), k) in enumerate(zip(ways.channels, newest, strict=True)):
            if k < 0:
                continue
            name, host_ns = link.config.name, int(batch.host_ns[k])
            self._users[channel.role] = (name, number), host_ns
            if isinstance(channel, Channel429):
                self.hearing.heard(f"{name}/{number}", host_ns)
                joined = laid.of(slot)
                self._waiting((name, number), channel).put(joined, int(ways.until_ns[slot]), int(ways.end_ns[slot]))
            else:
                self.hearing.heard(RADAR, host_ns)
                self.radials.put_all(link, channel, laid.radar_ns, laid.radar.data)

    @property
    def _longest_wait_ns(self) -> int:
        return LONGEST_WAIT_NS if self.patient else WAIT_NS

    def _waiting(self, here: Place, channel: Channel429) -> WaitingWords:
        if here not in self.words:
            self.words[here] = WaitingWords(channel)
        return self.words[here]

    def _packet(self, link: Link, packet: Packet, record: Raw) -> None:
        """Take any packet."""
        self._hear(record.adapter, record)
        if not link.count(packet):
            return
        try:
            self._by_type(link, packet, record)
        except MalformedBody:
            link.counters["malformed_bodies"] += 1

    def _by_type(self, link: Link, packet: Packet, record: Raw) -> None:
        if packet.time_ns > LATEST_DEVICE_NS:
            raise MalformedBody("device time is beyond any clock")
        if packet.type == f.WORDS_429:
            self._words(link, packet, record)
        elif packet.type == f.WORD_708:
            self._radar(link, packet, record)
        elif packet.type == f.HELLO:
            if new := link.announced(hello(packet)):
                self._read()  # as it was announced until now
                link.channels |= new
            self._expect(link, record)
        elif packet.type == f.HEARTBEAT:
            self._heartbeat(link, packet)
        elif packet.type != f.TIME_MARK:
            link.counters["packets_of_unknown_type"] += 1

    def _heartbeat(self, link: Link, packet: Packet) -> None:
        if lost := link.heartbeat(heartbeat(packet)):
            what = ", ".join(f"{count} {what}" for what, count in lost.items())
            self._telling.tell(link.config.name, "LOSS", what)

    def _hear(self, source: str, record: Raw) -> None:
        if reason := self.hearing.heard(source, record.stamp.monotonic_ns):
            self._telling.tell(source, "HEARD", reason)

    def _expect(self, link: Link, record: Raw) -> None:
        """What a bridge has announced shall be heard."""
        for number, channel in link.channels.items():
            source = f"{record.adapter}/{number}" if isinstance(channel, Channel429) else RADAR
            self.hearing.expect(source, record.stamp.monotonic_ns)

    def _claim(self, link: Link, packet: Packet, record: Raw) -> bool:
        """Whether the words of a packet can be used; if not, why is said once.

        Two IRUs, or two radars, are never mixed: the first channel of each role is used until it falls silent.
        """
        here, now_ns = (record.adapter, packet.channel), record.stamp.monotonic_ns
        channel = link.channels.get(packet.channel)
        if name := link.identify(packet):
            self._read()  # what waits came before this channel could take anything over
            reason = f"label 377 says what channel {packet.channel} is: read as {name} from now on"
            self._telling.tell(record.adapter, "IDENTIFIED", reason)
            return False
        if channel is None:
            why = "until a hello or [adapters.channels] says what it carries"
        elif packet.type != channel.packet_type or packet.flags & SPOILT:
            return False
        else:
            user, heard_ns = self._users.get(channel.role, (here, now_ns))
            if user == here or now_ns - heard_ns > QUIET_NS:
                self._users[channel.role] = (here, now_ns)
                return True
            why = f"because channel {user[1]} of {user[0]} is the {channel.role} in use"
        reason = f"channel {packet.channel} is recorded but not used {why}"
        if self._unused.get(here) != reason:
            self._unused[here] = reason
            self._telling.tell(record.adapter, "UNUSED_CHANNEL", reason)
        return False

    def _offset_ns(self, packet: Packet, record: Raw) -> int:
        """What to add to the packet's device times."""
        restarts = self.timebase.restarts
        offset_ns = self.timebase.offset_ns(record.adapter, packet.time_ns, record.stamp.monotonic_ns)
        if self.timebase.restarts > restarts:
            self._read()
            self._began_anew(record.adapter, packet.time_ns)
        self.now_ns, self.now_host_ns = packet.time_ns + offset_ns, record.stamp.monotonic_ns
        return offset_ns

    def _words(self, link: Link, packet: Packet, record: Raw) -> None:
        count = len(packet.body) // ENTRY_429.itemsize
        link.counters["words_429"] += count
        link.books[packet.channel].arrived += count
        if not count:
            raise MalformedBody("a packet of no words")
        usable = self._claim(link, packet, record)
        channel = link.channels.get(packet.channel)
        if not usable or not isinstance(channel, Channel429):
            link.counters["words_429_unused"] += count
            return
        offset_ns = self._offset_ns(packet, record)
        self._hear(f"{record.adapter}/{packet.channel}", record)
        here = record.adapter, packet.channel
        waiting = self.words.get(here)
        overtakes = waiting and waiting.until_ns and not waiting.end_ns <= packet.time_ns < waiting.until_ns
        if overtakes or channel.is_panel:
            self._read()
        waiting = self._waiting(here, channel)
        until_ns = packet.time_ns + self._longest_wait_ns if waiting.until_ns is None else waiting.until_ns
        end_ns = packet.time_ns + int.from_bytes(packet.body[-8:-4], "little")
        waiting.put(joined429(packet, offset_ns), until_ns, end_ns)
        if channel.is_panel:  # the radials before a command are compared with the one before it, those behind with it
            self._read()

    def _radar(self, link: Link, packet: Packet, record: Raw) -> None:
        word = radar_word(packet)
        link.counters["words_708"] += 1
        link.books[packet.channel].arrived += 1
        channel = link.radar(packet.channel)
        whole = not channel or word.bit_count == channel.profile.word_bits
        if channel and not whole:
            link.counters["words_708_" + ("short" if word.bit_count < channel.profile.word_bits else "long")] += 1
        usable = whole and self._claim(link, packet, record)
        if not usable or not channel:
            link.counters["words_708_unused"] += 1
            return
        self._hear(RADAR, record)
        offset_ns = self._offset_ns(packet, record)
        if self.radials.link is not link or self.radials.channel is not channel:
            self._read_sweep()
        if not self.radials.put(link, channel, packet.time_ns, offset_ns, word.data):
            self._read_sweep()
