"""Records to events: the one way through decoding and monitoring, live and in replay alike.

Reads no clock: whatever depends on time depends on the stamps of the records, ticks included. Words wait until a scan
ends or a tick passes, or a second of them has gathered, and are then decoded together.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from decoders import arinc429, arinc708, control708
from decoders import formats as f
from decoders.arinc708 import Radials
from decoders.racklink import ENTRY_429, MalformedBody, Packet, heartbeat, hello, radar_word
from gateway.channels import Channel429
from gateway.config import RackConfig, profile_of
from gateway.events import Event, IntegrityEvent, ScanEvent, StateEvent, StatusEvent, SummaryEvent
from gateway.hearing import QUIET_NS, RADAR, Hearing
from gateway.link import SPOILT, Link
from gateway.records import Raw, Record, Status, Tick
from gateway.timebase import Timebase
from gateway.waiting import WaitingRadials, WaitingWords, Words
from monitor.aircraft import Aircraft, status_name
from monitor.control_echo import ControlEcho
from monitor.integrity import Comparison, Monitor, Verdict
from monitor.scans import SILENCE_NS, Scan, ScanBuilder

LATEST_DEVICE_NS = 1 << 62  # far beyond any clock, and far from overflow

Watcher = Callable[[Scan, Verdict, Comparison | None], None]


class Pipeline:
    """Feed it records in order; it gives events. `watcher` sees each scan with its verdict, for reports.

    A pipeline that follows one that failed takes over its counters, the events it had not given yet and what it knew of
    the channels, and nothing else.
    """

    def __init__(
        self,
        config: RackConfig,
        monitor: Monitor | None,
        watcher: Watcher | None = None,
        before: "Pipeline | None" = None,
    ) -> None:
        self._config = config
        self._monitor = monitor
        self._watcher = watcher
        profile = profile_of(config.radar_profile)
        self._links = {a.name: Link(a, profile) for a in config.adapters}
        self._timebase = Timebase()
        self._aircraft = Aircraft(config.monitor.height_source)
        self._scans = ScanBuilder()
        self._echo = ControlEcho(config.monitor.control_delay_s)
        self._counters: Counter[str] = Counter()
        self._now_ns = 0  # common time of the latest word
        self._now_host_ns: int | None = None  # and when that word was read
        self._hearing = Hearing({name: link.advice for name, link in self._links.items()})
        self._users: dict[str, tuple[tuple[str, int], int]] = {}  # by role: adapter and channel, and when last heard
        self._unused: dict[tuple[str, int], str] = {}  # why a channel is not used, told already
        self._doubted: set[str] = set()  # quantities whose words seem to be read in a wrong way, told already
        self._troubles: dict[str, str] = {}  # what the next verdict must own up to, by adapter
        self._waiting: dict[tuple[str, int], tuple[Channel429, WaitingWords]] = {}  # by adapter and channel
        self._radials = WaitingRadials()
        self._stamp = 0, 0  # what an event carries of the record that causes it: UTC in ns, and sequence
        self._fed = False
        self._events: list[Event] = []  # not given yet
        if before:
            self._counters, self._events = before._counters, before._events
            self._scans.number = before._scans.number
            self._echo.unlike = before._echo.unlike
            for name, link in self._links.items():
                link.succeed(before._links[name])
            for (adapter, _), (_, waiting) in before._waiting.items():
                self._links[adapter].counters["words_429_unused"] += len(waiting)
            if before._radials.link:
                before._radials.link.counters["words_708_unused"] += len(before._radials)

    def feed(self, record: Record) -> list[Event]:
        """The events that one record causes."""
        self._stamp, self._fed = (record.stamp.utc_ns, record.sequence), True
        if isinstance(record, Raw):
            self._raw(record)
        elif isinstance(record, Tick):
            self._tick(record)
        elif isinstance(record, Status):
            self._status(record)
        else:
            self._tell("host", "NOTE", record.text)
        return self._given()

    def finish(self) -> list[Event]:
        """The sweep that is still open, and the summary of every counter."""
        if not self._fed:
            return []
        self._read_what_waits()
        self._judge(self._scans.finish())
        counters = dict(self._counters)
        counters |= {"clock_restarts": self._timebase.restarts, "radials_unlike_command": self._echo.unlike}
        for name, link in self._links.items():
            counters |= {f"{name}.{key}": value for key, value in link.all_counters().items()}
        self._events.append(SummaryEvent(*self._stamp, dict(sorted(counters.items()))))
        return self._given()

    def _given(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def _tell(self, adapter: str, state: str, reason: str) -> None:
        self._events.append(StatusEvent(*self._stamp, adapter, state, reason))

    def _status(self, record: Status) -> None:
        self._counters[f"{record.adapter}.{record.state.lower()}"] += 1
        if record.state == "UP":
            self._hearing.expect(record.adapter, record.stamp.monotonic_ns)
            if self._monitor:
                self._hearing.expect(RADAR, record.stamp.monotonic_ns)
        if record.state in ("LOST", "BEHIND", "FAILED"):
            self._troubles[record.adapter] = f"degraded: {record.adapter} {record.state}: {record.reason}"
        self._tell(record.adapter, record.state, record.reason)

    def _raw(self, record: Raw) -> None:
        link = self._links.get(record.adapter)
        if link is None:
            self._counters["chunks_of_unknown_adapter"] += 1
            return
        link.counters["chunks"] += 1
        if record.dropped_before:
            link.dropped(record.dropped_before)
        self._hearing.bytes_came(record.adapter, record.stamp.monotonic_ns)
        for packet in link.framer.feed(record.data):
            self._hear(record.adapter, record)
            if not link.count(packet):
                continue
            try:
                self._packet(link, packet, record)
            except MalformedBody:
                link.counters["malformed_bodies"] += 1

    def _hear(self, source: str, record: Raw) -> None:
        if reason := self._hearing.heard(source, record.stamp.monotonic_ns):
            self._tell(source, "HEARD", reason)

    def _packet(self, link: Link, packet: Packet, record: Raw) -> None:
        if packet.time_ns > LATEST_DEVICE_NS:
            raise MalformedBody("device time is beyond any clock")
        if packet.type == f.WORDS_429:
            self._words(link, packet, record)
        elif packet.type == f.WORD_708:
            self._radar(link, packet, record)
        elif packet.type == f.HELLO:
            said = hello(packet)
            self._read_what_waits()  # as it was announced until now
            link.hello(said)
            self._expect(link, record)
        elif packet.type == f.HEARTBEAT:
            if lost := link.heartbeat(heartbeat(packet)):
                self._tell(record.adapter, "LOSS", ", ".join(f"{count} {what}" for what, count in lost.items()))
        elif packet.type != f.TIME_MARK:
            link.counters["packets_of_unknown_type"] += 1

    def _expect(self, link: Link, record: Raw) -> None:
        """What a bridge has announced shall be heard."""
        for number, channel in link.channels.items():
            source = f"{record.adapter}/{number}" if isinstance(channel, Channel429) else RADAR
            self._hearing.expect(source, record.stamp.monotonic_ns)

    def _claim(self, link: Link, packet: Packet, record: Raw) -> bool:
        """Whether the words of a packet can be used; if not, why is said once.

        Two IRUs, or two radars, are never mixed: the first channel of each role is used until it falls silent.
        """
        here, now_ns = (record.adapter, packet.channel), record.stamp.monotonic_ns
        channel = link.channels.get(packet.channel)
        if name := link.identify(packet):
            reason = f"label 377 says what channel {packet.channel} is: read as {name} from now on"
            self._tell(record.adapter, "IDENTIFIED", reason)
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
            self._tell(record.adapter, "UNUSED_CHANNEL", reason)
        return False

    def _offset_ns(self, packet: Packet, record: Raw) -> int:
        """What to add to the packet's device times; a clock that began anew makes all older state worthless."""
        restarts = self._timebase.restarts
        offset_ns = self._timebase.offset_ns(record.adapter, packet.time_ns, record.stamp.monotonic_ns)
        if self._timebase.restarts > restarts:
            self._read_what_waits()
            self._judge(self._scans.finish())
            self._aircraft = Aircraft(self._config.monitor.height_source)
            self._echo.forget()
            reason = f"the bridge's clock began anew at {packet.time_ns / 1e9:.3f} s; the state before it is dropped"
            self._troubles[f"clock of {record.adapter}"] = f"degraded: {record.adapter}: {reason}"
            self._tell(record.adapter, "CLOCK_RESTARTED", reason)
        self._now_ns, self._now_host_ns = packet.time_ns + offset_ns, record.stamp.monotonic_ns
        return offset_ns

    def _words(self, link: Link, packet: Packet, record: Raw) -> None:
        count = len(packet.body) // ENTRY_429.itemsize
        link.counters["words_429"] += count
        link.books[packet.channel].arrived += count
        if not count:
            link.counters["malformed_bodies"] += 1
            return
        usable = self._claim(link, packet, record)
        channel = link.channels.get(packet.channel)
        if not usable or not isinstance(channel, Channel429):
            link.counters["words_429_unused"] += count
            return
        here = record.adapter, packet.channel
        offset_ns = self._offset_ns(packet, record)
        self._hear(f"{record.adapter}/{packet.channel}", record)
        _, waiting = self._waiting.setdefault(here, (channel, WaitingWords()))
        if channel.is_panel:  # the radials before it are compared with the command before it
            self._read_what_waits()
        elif not waiting.has_room_for(packet):
            self._read_words(here)
        waiting.put(packet, offset_ns)
        if channel.is_panel:
            self._waiting[here] = channel, waiting
            self._read_words(here)

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
        time_ns = packet.time_ns + self._offset_ns(packet, record)
        if self._radials.link is not link or self._radials.channel is not channel:
            self._read_what_waits()
        if not self._radials.put(link, channel, time_ns, word.data):
            self._read_what_waits()

    def _read_what_waits(self) -> None:
        """Decode all that waits: first what the aircraft and the panel say, then the radials, which may end a scan."""
        for here in self._waiting:
            self._read_words(here)
        self._waiting.clear()  # a channel may be another one from now on
        self._read_radials()

    def _read_words(self, here: tuple[str, int]) -> None:
        channel, waiting = self._waiting[here]
        words = waiting.take()
        if words is None:
            return
        link, joined = self._links[here[0]], words.joined
        link.counters["malformed_bodies"] += joined.malformed
        link.counters["words_429_unused"] += joined.left_out
        if len(joined.words):
            self._decode(link, f"{here[0]}/{here[1]}", channel, words)

    def _decode(self, link: Link, about: str, channel: Channel429, words: Words) -> None:
        joined = words.joined
        values = arinc429.decode(joined.words, channel.definitions, channel.orientation)
        for status, count in enumerate(np.bincount(values.status).tolist()):
            if status and count:
                link.counters[f"words_429_{arinc429.Status(status).name.lower()}"] += count
        for finding in channel.health.feed(joined.time_ns, joined.words, values):
            state = "BUS_WRONG" if finding.wrong else "BUS_RIGHT"
            self._counters[f"{about}.{state.lower()}"] += 1
            self._tell(about, state, finding.reason)
        sent_ns = joined.time_ns + words.offset_ns
        if channel.is_panel:
            for k in np.flatnonzero(values.status == arinc429.Status.NORMAL):
                definition = channel.definitions.labels[int(values.label[k])]
                command = control708.decode(int(joined.words[k]), definition, self._echo.command)
                self._echo.feed_command(int(sent_ns[k]), command)
        used = channel.uses(joined.words, values.label)
        if used.any():
            true_ns = sent_ns - channel.delays_ns[values.label]
            some = arinc429.Values429(values.label[used], values.value[used], values.status[used])
            self._aircraft.feed(channel.definitions, true_ns[used], joined.words[used], some, channel.join_rule)

    def _read_radials(self) -> None:
        waiting = self._radials.take()
        link, channel = self._radials.link, self._radials.channel
        if waiting is None or link is None or channel is None:
            return
        times_ns, words = waiting
        radials = arinc708.unpack(words, channel.profile)
        unusual = radials.unusual[radials.unusual > 0]
        for bit, name in enumerate(f.UNUSUAL_708):
            if count := int(np.count_nonzero(unusual >> bit & 1)):
                link.counters[f"words_708_{name}"] += count
        self._compare_with_command(link, times_ns.tolist(), radials)
        self._judge(self._scans.feed(times_ns, radials))

    def _compare_with_command(self, link: Link, times_ns: list[int], radials: Radials) -> None:
        if not self._echo.listens:
            return
        for k, time_ns in enumerate(times_ns):
            if finding := self._echo.feed_radial(time_ns, radials, k):
                link.counters[finding.state.lower()] += 1
                self._tell(link.config.name, *finding)

    def _judge(self, scans: Iterable[Scan]) -> None:
        for scan in scans:
            self._events.append(
                ScanEvent(
                    *self._stamp,
                    scan=scan.number,
                    radials=len(scan.time_ns),
                    sector=scan.sector_deg,
                    range_nm=scan.range_nm,
                    tilt_deg=scan.tilt_deg,
                    gaps=scan.missing,
                    repeated=scan.repeated,
                    cut_off=scan.cut_off,
                )
            )
            if self._monitor is None:
                continue
            verdict, comparison = self._monitor.judge(scan, self._aircraft)
            losses = [loss for link in self._links.values() for loss in link.take_losses()]
            verdict = replace(verdict, reasons=(*verdict.reasons, *self._troubles.values(), *losses))
            self._troubles.clear()
            if self._watcher:
                self._watcher(scan, verdict, comparison)
            self._say(verdict, self._monitor)

    def _say(self, verdict: Verdict, monitor: Monitor) -> None:
        self._counters[f"verdicts_{verdict.verdict}"] += 1
        settings = monitor.settings
        event = IntegrityEvent(*self._stamp, method=settings.method, p_fa=settings.p_fa, **vars(verdict))
        self._events.append(event)

    def _tick(self, record: Tick) -> None:
        now_ns = record.stamp.monotonic_ns
        self._read_what_waits()
        if self._hearing.silent_ns(RADAR, now_ns) > SILENCE_NS:
            self._judge(self._scans.finish())
        for source, reason in self._hearing.fell_silent(now_ns):
            self._tell(source, "QUIET", reason)
            if source == RADAR and self._monitor:
                self._say(self._monitor.unavailable(self._scans.skip(), [f"radar: {reason}"]), self._monitor)
        for quantity, doubt in self._aircraft.doubts().items():
            if quantity not in self._doubted:
                self._doubted.add(quantity)
                self._troubles[quantity] = f"degraded: {quantity}: {doubt}"
                self._tell(quantity, "STATE_DOUBT", doubt)
        self._events.append(self._state(record))

    def _state(self, record: Tick) -> StateEvent:
        heard_ns = self._now_host_ns
        silent_ns = 0 if heard_ns is None else record.stamp.monotonic_ns - heard_ns
        now_ns = self._now_ns + silent_ns  # without words the state must still grow old
        values: dict[str, float | None] = {}
        validity: dict[str, str] = {}
        age_s: dict[str, float | None] = {}
        for name, track in self._aircraft.tracks.items():
            at = track.at(np.array([now_ns]))
            status = int(at.status[0])
            values[name] = float(at.value[0]) if status == 0 else None
            validity[name] = status_name(status)
            newest = track.newest
            age_s[name] = (now_ns - newest[0]) / 1e9 if newest else None
        utc = self._aircraft.utc.at(now_ns)
        values["utc_s"] = None if utc.utc_ns is None else utc.utc_ns / 1e9
        validity["utc_s"] = utc.validity
        return StateEvent(*self._stamp, values, validity, age_s)
