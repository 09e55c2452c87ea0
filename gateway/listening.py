"""From recorded chunks to words that wait: framing, losses, which channels are used, who is heard, and whose time.

Nothing is decoded here but what says what a channel is. Whoever makes a `Listener` gives `read`, which takes what
waits and is called before anything changes how words are to be read, and `read_sweep`, which takes the radials and is
called as soon as one may end its sweep.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from decoders import formats as f
from decoders.racklink import ENTRY_429, MalformedBody, Packet, heartbeat, hello, radar_word
from gateway.channels import Channel429, Channel708
from gateway.config import RackConfig, profile_of
from gateway.hearing import QUIET_NS, RADAR, Hearing
from gateway.link import SPOILT, Link
from gateway.plain import (
    CHANNELS,
    COUNT_BYTES,
    LATEST_DEVICE_NS,
    RADIALS,
    WORDS,
    Batch,
    Ways,
    count_plain,
    framed,
    gathered,
)
from gateway.records import Raw
from gateway.telling import Telling
from gateway.timebase import Timebase
from gateway.waiting import LONGEST_WAIT_NS, MOST_RADIALS, WAIT_NS, WaitingRadials, WaitingWords
from monitor.quantities import are_distinct

Place = tuple[str, int]  # adapter and channel
WORTH_WHILE = 16  # packets: fewer are taken sooner one by one


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

    def framed(self, records: Sequence[Raw]) -> Batch:
        """The packets that chunks of known adapters complete, before which nothing was dropped; for `take_all`."""
        return framed([*self.links.values()], records)

    def take_all(self, records: Sequence[Raw], batch: Batch) -> None:
        """Take chunks and their packets: the same as one by one, and sooner."""
        for name, count in Counter(map(attrgetter("adapter"), records)).items():
            self.links[name].counters["chunks"] += count
        for name, record in {record.adapter: record for record in records}.items():  # the last of each
            self.hearing.bytes_came(name, record.stamp.monotonic_ns)
        links = [*self.links.values()]
        at, end = 0, len(batch.link)
        while at < end:
            if end - at >= WORTH_WHILE:
                at += self._take_plain(links, batch.rest(at))
            if at < end:
                record = records[batch.record[at]]
                self._telling.begin(record)
                self._packet(links[batch.link[at]], batch.packets.packet(at), record)
                at += 1
        self._telling.begin(records[-1])

    def _take_plain(self, links: Sequence[Link], batch: Batch) -> int:
        """Take the packets in front of which there is nothing to say; how many these are."""
        ways, radials = self._ways(links), self.radials
        sequence = np.array([link.next_sequence for link in links], np.int64)
        latest_ns = np.array([link.latest_ns for link in links], np.int64)
        offset_ns = np.empty(len(batch.link), np.int64)
        bits = radials.channel.profile.word_bits if radials.channel else 0
        room = MOST_RADIALS - 1 - len(radials)
        clocks, reference = self.timebase.clocks, self.timebase.reference
        header, start, size, _, data = batch.packets
        count = count_plain(
            header, start, size, data, batch.link, batch.host_ns, *ways, sequence, latest_ns,
            clocks, reference, radials.watch.last, bits, room, self._longest_wait_ns, offset_ns,
        )  # fmt: skip
        if not count:
            return 0
        self.now_ns = int(header["time_ns"][count - 1]) + int(offset_ns[count - 1])
        self.now_host_ns = int(batch.host_ns[count - 1])
        places = batch.link[:count] * CHANNELS + header["channel"][:count]
        for number, link in enumerate(links):
            own = np.flatnonzero(batch.link[:count] == number)
            if not len(own):
                continue
            link.count_plain(batch.packets, own)
            self.hearing.heard(link.config.name, int(batch.host_ns[own[-1]]))
            for channel in np.flatnonzero(ways.kind[number]).tolist():
                here = np.flatnonzero(places == number * CHANNELS + channel)
                if len(here):
                    self._put(link, channel, batch, here, offset_ns[here], int(ways.end_ns[number, channel]))
        return int(count)

    def _ways(self, links: Sequence[Link]) -> Ways:
        """How the packets of each channel may be taken now."""
        ways, radials = Ways.careful(len(links)), self.radials
        for number, link in enumerate(links):
            name = link.config.name
            if self.hearing.is_quiet(name):
                continue
            for channel, what in link.channels.items():
                here = name, channel
                if here != self._users.get(what.role, (None, 0))[0]:
                    continue
                if isinstance(what, Channel708):
                    if radials.link is link and radials.channel is what and not self.hearing.is_quiet(RADAR):
                        ways.kind[number, channel] = RADIALS
                elif not what.is_panel and not self.hearing.is_quiet(f"{name}/{channel}"):
                    ways.kind[number, channel] = WORDS
                    waiting = self.words.get(here)
                    if waiting and waiting.until_ns is not None:
                        ways.end_ns[number, channel] = waiting.end_ns
                        ways.until_ns[number, channel] = waiting.until_ns
        return ways

    def _put(
        self, link: Link, number: int, batch: Batch, here: NDArray[np.intp], offset_ns: NDArray[np.int64], end_ns: int
    ) -> None:
        """Let the plain packets `here` of a channel wait; offsets lead from their device times to the common ones."""
        header, start, size, _, data = batch.packets
        host_ns, times_ns = int(batch.host_ns[here[-1]]), header["time_ns"][here].astype(np.int64)
        channel, sizes = link.channels[number], size[here]
        self._users[channel.role] = (link.config.name, number), host_ns
        if isinstance(channel, Channel429):
            words = int(sizes.sum()) // ENTRY_429.itemsize
            link.counters["words_429"] += words
            self.hearing.heard(f"{link.config.name}/{number}", host_ns)
            bodies = gathered(data, start[here], sizes).tobytes()
            waiting = self._waiting((link.config.name, number), channel)
            waiting.put(times_ns, sizes, bodies, offset_ns, end_ns)
        else:
            words = len(here)
            link.counters["words_708"] += words
            self.hearing.heard(RADAR, host_ns)
            bodies = gathered(data, start[here] + COUNT_BYTES, sizes - COUNT_BYTES).tobytes()
            self.radials.put_all(link, channel, times_ns + offset_ns, bodies)
        link.books[number].arrived += words

    @property
    def _longest_wait_ns(self) -> int:
        return LONGEST_WAIT_NS if self.patient else WAIT_NS

    def _waiting(self, here: Place, channel: Channel429) -> WaitingWords:
        if here not in self.words:
            self.words[here] = WaitingWords(channel, self._longest_wait_ns)
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
            said = hello(packet)
            self._read()  # as it was announced until now
            link.hello(said)
            self._expect(link, record)
        elif packet.type == f.HEARTBEAT:
            if lost := link.heartbeat(heartbeat(packet)):
                self._telling.tell(record.adapter, "LOSS", ", ".join(f"{count} {what}" for what, count in lost.items()))
        elif packet.type != f.TIME_MARK:
            link.counters["packets_of_unknown_type"] += 1

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
        end_ns = packet.time_ns + int.from_bytes(packet.body[-8:-4], "little")
        waiting.put([packet.time_ns], [len(packet.body)], packet.body, [offset_ns], end_ns)
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
