"""Records to events: the one way through decoding and monitoring, live and in replay alike.

Reads no clock: whatever depends on time depends on the stamps of the records, ticks included.
"""

from collections import Counter
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429, arinc708, control708
from decoders import formats as f
from decoders.health429 import Finding
from decoders.racklink import MalformedBody, Packet, heartbeat, hello, radar_word, words429
from gateway.config import RackConfig, profile_of
from gateway.events import Event, IntegrityEvent, ScanEvent, StateEvent, StatusEvent, SummaryEvent
from gateway.hearing import QUIET_NS, RADAR, Hearing
from gateway.link import SPOILT, Channel429, Link
from gateway.records import Note, Raw, Record, Status, Tick
from gateway.timebase import Timebase
from monitor.aircraft import Aircraft, status_name
from monitor.control_echo import ControlEcho
from monitor.integrity import Comparison, Monitor, Verdict
from monitor.scans import SILENCE_NS, Scan, ScanBuilder

LATEST_DEVICE_NS = 1 << 62  # far beyond any clock, and far from overflow

Watcher = Callable[[Scan, Verdict, Comparison | None], None]


class Pipeline:
    """Feed it records in order; it gives events. `watcher` sees each scan with its verdict, for reports.

    A pipeline that follows one that failed takes over its counters and what it knew of the channels, and nothing else.
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
        self._last: Record | None = None
        if before:
            self._counters = before._counters
            self._scans.number = before._scans.number
            self._echo.unlike = before._echo.unlike
            for name, link in self._links.items():
                link.succeed(before._links[name])

    def feed(self, record: Record) -> Iterator[Event]:
        """The events that one record causes."""
        self._last = record
        if isinstance(record, Raw):
            yield from self._raw(record)
        elif isinstance(record, Status):
            self._counters[f"{record.adapter}.{record.state.lower()}"] += 1
            if record.state == "UP":
                self._hearing.expect(record.adapter, record.stamp.monotonic_ns)
                if self._monitor:
                    self._hearing.expect(RADAR, record.stamp.monotonic_ns)
            if record.state in ("LOST", "BEHIND", "FAILED"):
                self._troubles[record.adapter] = f"degraded: {record.adapter} {record.state}: {record.reason}"
            yield StatusEvent(record.stamp.utc_ns, record.sequence, record.adapter, record.state, record.reason)
        elif isinstance(record, Note):
            yield StatusEvent(record.stamp.utc_ns, record.sequence, "host", "NOTE", record.text)
        else:
            yield from self._tick(record)

    def finish(self) -> Iterator[Event]:
        """The sweep that is still open, and the summary of every counter."""
        if self._last is None:
            return
        for scan in self._scans.finish():
            yield from self._judge(scan, self._last)
        counters = dict(self._counters)
        counters |= {"clock_restarts": self._timebase.restarts, "radials_unlike_command": self._echo.unlike}
        for name, link in self._links.items():
            counters |= {f"{name}.{key}": value for key, value in link.all_counters().items()}
        yield SummaryEvent(self._last.stamp.utc_ns, self._last.sequence, dict(sorted(counters.items())))

    def _raw(self, record: Raw) -> Iterator[Event]:
        link = self._links.get(record.adapter)
        if link is None:
            self._counters["chunks_of_unknown_adapter"] += 1
            return
        link.counters["chunks"] += 1
        link.dropped(record.dropped_before)
        self._hearing.bytes_came(record.adapter, record.stamp.monotonic_ns)
        for packet in link.framer.feed(record.data):
            yield from self._hear(record.adapter, record)
            if not link.count(packet):
                continue
            try:
                yield from self._packet(link, packet, record)
            except MalformedBody:
                link.counters["malformed_bodies"] += 1

    def _hear(self, source: str, record: Raw) -> Iterator[Event]:
        if reason := self._hearing.heard(source, record.stamp.monotonic_ns):
            yield StatusEvent(record.stamp.utc_ns, record.sequence, source, "HEARD", reason)

    def _packet(self, link: Link, packet: Packet, record: Raw) -> Iterator[Event]:
        if packet.time_ns > LATEST_DEVICE_NS:
            raise MalformedBody("device time is beyond any clock")
        if packet.type == f.HELLO:
            link.hello(hello(packet))
            self._expect(link, record)
        elif packet.type == f.WORDS_429:
            yield from self._words(link, packet, record)
        elif packet.type == f.WORD_708:
            yield from self._radar(link, packet, record)
        elif packet.type == f.HEARTBEAT:
            if lost := link.heartbeat(heartbeat(packet)):
                reason = ", ".join(f"{count} {what}" for what, count in lost.items())
                yield StatusEvent(record.stamp.utc_ns, record.sequence, record.adapter, "LOSS", reason)
        elif packet.type != f.TIME_MARK:
            link.counters["packets_of_unknown_type"] += 1

    def _expect(self, link: Link, record: Raw) -> None:
        """What a bridge has announced shall be heard."""
        for number, channel in link.channels.items():
            source = f"{record.adapter}/{number}" if isinstance(channel, Channel429) else RADAR
            self._hearing.expect(source, record.stamp.monotonic_ns)

    def _claim(self, link: Link, packet: Packet, record: Raw) -> Generator[Event, None, bool]:
        """Whether the words of a packet can be used; if not, why is said once.

        Two IRUs, or two radars, are never mixed: the first channel of each role is used until it falls silent.
        """
        here, now_ns = (record.adapter, packet.channel), record.stamp.monotonic_ns
        channel = link.channels.get(packet.channel)
        if name := link.identify(packet):
            reason = f"label 377 says what channel {packet.channel} is: read as {name} from now on"
            yield StatusEvent(record.stamp.utc_ns, record.sequence, record.adapter, "IDENTIFIED", reason)
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
            yield StatusEvent(record.stamp.utc_ns, record.sequence, record.adapter, "UNUSED_CHANNEL", reason)
        return False

    def _offset_ns(self, packet: Packet, record: Raw) -> Generator[Event, None, int]:
        """What to add to the packet's device times; a clock that began anew makes all older state worthless."""
        restarts = self._timebase.restarts
        offset_ns = self._timebase.offset_ns(record.adapter, packet.time_ns, record.stamp.monotonic_ns)
        if self._timebase.restarts > restarts:
            for scan in self._scans.finish():
                yield from self._judge(scan, record)
            self._aircraft = Aircraft(self._config.monitor.height_source)
            self._echo.forget()
            reason = f"the bridge's clock began anew at {packet.time_ns / 1e9:.3f} s; the state before it is dropped"
            self._troubles[f"clock of {record.adapter}"] = f"degraded: {record.adapter}: {reason}"
            yield StatusEvent(record.stamp.utc_ns, record.sequence, record.adapter, "CLOCK_RESTARTED", reason)
        self._now_ns, self._now_host_ns = packet.time_ns + offset_ns, record.stamp.monotonic_ns
        return offset_ns

    def _words(self, link: Link, packet: Packet, record: Raw) -> Iterator[Event]:
        block = words429(packet)
        link.counters["words_429"] += len(block.words)
        link.books[packet.channel].arrived += len(block.words)
        in_order = bool(np.all(np.diff(block.time_ns) >= 0))
        if not (block.well_formed and in_order):
            link.counters["malformed_bodies"] += 1
        usable = len(block.words) and in_order and (yield from self._claim(link, packet, record))
        channel = link.channels.get(packet.channel)
        if not usable or not isinstance(channel, Channel429):
            link.counters["words_429_unused"] += len(block.words)
            return
        values = arinc429.decode(block.words, channel.definitions, channel.orientation)
        for status, count in enumerate(np.bincount(values.status).tolist()):
            if status and count:
                link.counters[f"words_429_{arinc429.Status(status).name.lower()}"] += count
        offset_ns = yield from self._offset_ns(packet, record)
        yield from self._hear(f"{record.adapter}/{packet.channel}", record)
        for finding in channel.health.feed(block.time_ns, block.words, values):
            yield self._finding(f"{record.adapter}/{packet.channel}", finding, record)
        if channel.is_panel:
            self._command(channel, block.time_ns + offset_ns, block.words, values)
        true_ns = block.time_ns + offset_ns - channel.delays_ns[values.label]
        used = channel.uses(block.words, values.label)
        if used.any():
            some = arinc429.Values429(values.label[used], values.value[used], values.status[used])
            self._aircraft.feed(channel.definitions, true_ns[used], block.words[used], some, channel.join_rule)

    def _finding(self, about: str, finding: Finding, record: Raw) -> StatusEvent:
        state = "BUS_WRONG" if finding.wrong else "BUS_RIGHT"
        self._counters[f"{about}.{state.lower()}"] += 1
        return StatusEvent(record.stamp.utc_ns, record.sequence, about, state, finding.reason)

    def _command(
        self, channel: Channel429, time_ns: NDArray[np.int64], words: NDArray[np.uint32], values: arinc429.Values429
    ) -> None:
        for k in np.flatnonzero(values.status == arinc429.Status.NORMAL):
            definition = channel.definitions.labels[int(values.label[k])]
            command = control708.decode(int(words[k]), definition, self._echo.command)
            self._echo.feed_command(int(time_ns[k]), command)

    def _radar(self, link: Link, packet: Packet, record: Raw) -> Iterator[Event]:
        word = radar_word(packet)
        link.counters["words_708"] += 1
        link.books[packet.channel].arrived += 1
        channel = link.radar(packet.channel)
        whole = not channel or word.bit_count == channel.profile.word_bits
        if channel and not whole:
            link.counters["words_708_" + ("short" if word.bit_count < channel.profile.word_bits else "long")] += 1
        usable = whole and (yield from self._claim(link, packet, record))
        if not usable or not channel:
            link.counters["words_708_unused"] += 1
            return
        yield from self._hear(RADAR, record)
        radials = arinc708.unpack(np.frombuffer(word.data, np.uint8)[np.newaxis], channel.profile)
        for bit, name in enumerate(f.UNUSUAL_708):
            if radials.unusual[0] >> bit & 1:
                link.counters[f"words_708_{name}"] += 1
        time_ns = packet.time_ns + (yield from self._offset_ns(packet, record))
        if finding := self._echo.feed_radial(time_ns, radials):
            link.counters[finding.state.lower()] += 1
            yield StatusEvent(record.stamp.utc_ns, record.sequence, record.adapter, *finding)
        for scan in self._scans.feed(np.array([time_ns]), radials):
            yield from self._judge(scan, record)

    def _judge(self, scan: Scan, record: Record) -> Iterator[Event]:
        stamp = record.stamp.utc_ns, record.sequence
        yield ScanEvent(
            *stamp,
            scan=scan.number,
            radials=len(scan.time_ns),
            sector=scan.sector_deg,
            range_nm=scan.range_nm,
            tilt_deg=scan.tilt_deg,
            gaps=scan.missing,
            repeated=scan.repeated,
            cut_off=scan.cut_off,
        )
        if self._monitor is None:
            return
        verdict, comparison = self._monitor.judge(scan, self._aircraft)
        losses = [loss for link in self._links.values() for loss in link.take_losses()]
        verdict = replace(verdict, reasons=(*verdict.reasons, *self._troubles.values(), *losses))
        self._troubles.clear()
        if self._watcher:
            self._watcher(scan, verdict, comparison)
        yield self._verdict(verdict, self._monitor, record)

    def _verdict(self, verdict: Verdict, monitor: Monitor, record: Record) -> IntegrityEvent:
        self._counters[f"verdicts_{verdict.verdict}"] += 1
        settings = monitor.settings
        stamp = record.stamp.utc_ns, record.sequence
        return IntegrityEvent(*stamp, method=settings.method, p_fa=settings.p_fa, **vars(verdict))

    def _tick(self, record: Tick) -> Iterator[Event]:
        stamp = record.stamp.utc_ns, record.sequence
        now_ns = record.stamp.monotonic_ns
        if self._hearing.silent_ns(RADAR, now_ns) > SILENCE_NS:
            for scan in self._scans.finish():
                yield from self._judge(scan, record)
        for source, reason in self._hearing.fell_silent(now_ns):
            yield StatusEvent(*stamp, source, "QUIET", reason)
            if source == RADAR and self._monitor:
                silence = self._monitor.unavailable(self._scans.skip(), [f"radar: {reason}"])
                yield self._verdict(silence, self._monitor, record)
        for quantity, doubt in self._aircraft.doubts().items():
            if quantity not in self._doubted:
                self._doubted.add(quantity)
                self._troubles[quantity] = f"degraded: {quantity}: {doubt}"
                yield StatusEvent(*stamp, quantity, "STATE_DOUBT", doubt)
        yield self._state(record)

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
        return StateEvent(record.stamp.utc_ns, record.sequence, values, validity, age_s)
