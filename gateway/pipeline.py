"""Records to events: the one way through decoding and monitoring, live and in replay alike.

Reads no clock: whatever depends on time depends on the stamps of the records, ticks included. Words wait until a scan
ends or a tick asks for the state, or a second of them has gathered, and are then decoded together.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from operator import itemgetter

import numpy as np

from decoders import arinc429, arinc708, control708
from decoders import formats as f
from decoders.arinc708 import Radials
from decoders.racklink import Joined
from gateway.channels import Channel429
from gateway.chunks import Block, Chunks
from gateway.config import RackConfig
from gateway.events import Event, IntegrityEvent, ScanEvent, StateEvent, SummaryEvent
from gateway.hearing import RADAR
from gateway.link import Link
from gateway.listening import Listener
from gateway.plain import Batch
from gateway.records import Raw, Record, Status, Tick
from gateway.telling import Telling
from monitor.aircraft import Aircraft, status_name
from monitor.comparison import Comparison
from monitor.control_echo import ControlEcho
from monitor.integrity import Monitor
from monitor.scans import SILENCE_NS, Scan, ScanBuilder
from monitor.verdict import Verdict

Watcher = Callable[[Scan, Verdict, Comparison | None], None]


class Pipeline:
    """Feed it records in order; it gives events. `watcher` sees each scan with its verdict, for reports and exports.

    Without `tells_state` no tick tells the aircraft's state. Behind a scan that `watcher` sees stand the `aircraft` and
    the `listener` of that moment.

    A pipeline that follows one that failed takes over its counters, the events it had not given yet and what it knew of
    the channels, and nothing else.
    """

    def __init__(
        self,
        config: RackConfig,
        monitor: Monitor | None,
        watcher: Watcher | None = None,
        before: "Pipeline | None" = None,
        *,
        tells_state: bool = True,
    ) -> None:
        self._config = config
        self._monitor: Monitor | None = before._monitor if before else monitor and monitor.anew()
        self._watcher = watcher
        self._tells_state = tells_state
        self._telling: Telling = before._telling if before else Telling()
        self.listener = Listener(
            config, self._telling, self._read, self._read_sweep, self._clock_began_anew, patient=not tells_state
        )
        self.aircraft = Aircraft(config.monitor.height_source)
        self._scans = ScanBuilder()
        self._echo = ControlEcho(config.monitor.control_delay_s)
        self._counters: Counter[str] = Counter()
        self._doubted: set[str] = set()  # quantities whose words seem to be read in a wrong way, told already
        self._owned_up: set[str] = set()  # and those that a verdict has named
        self._troubles: dict[str, str] = {}  # what the next verdict must own up to, by adapter
        if monitor and not before:
            self._troubles |= {text: text for text in monitor.told_first}
        if before:
            self._counters = before._counters
            self._scans.number = before._scans.number
            self._echo.unlike = before._echo.unlike
            self.listener.succeed(before.listener)

    def feed(self, record: Record) -> list[Event]:
        """The events that one record causes."""
        self._take(record)
        return self._telling.given()

    def feed_all(self, block: Block) -> list[Event]:
        """The events that many records cause: the same as one by one, and sooner."""
        begin, chunks = 0, block.chunks
        for end in (*self.listener.alone(chunks), len(chunks)):
            self._take_all(block.part(begin, end))
            if end < len(chunks):
                self._take(chunks.record(end))
            begin = end + 1
        return self._telling.given()

    def _take_all(self, block: Block) -> None:
        """Take records whose chunks may be framed together."""
        chunks, batch = block.chunks, self.listener.framed(block.chunks)
        begin, since_ns = 0, None
        for end, record in block.others:
            if since_ns is None:
                since_ns = (chunks.record(begin) if begin < end else record).stamp.monotonic_ns
            if self._is_idle(record, since_ns):
                continue
            self._listen(chunks, batch, begin, end)
            self._take(record)
            begin, since_ns = end, None
        self._listen(chunks, batch, begin, len(chunks))
        if chunks or block.others:
            self._telling.begin(block.last)

    def _listen(self, chunks: Chunks, batch: Batch, begin: int, end: int) -> None:
        if begin < end:
            self.listener.take_all(chunks.part(begin, end), batch.of_records(begin, end))

    def _is_idle(self, record: Record, since_ns: int) -> bool:
        """Whether a tick will find nothing to say, whatever comes before it from `since_ns` on."""
        if not (isinstance(record, Tick) and self.listener.patient):
            return False
        now_ns, hearing = record.stamp.monotonic_ns, self.listener.hearing
        soon = now_ns - since_ns <= SILENCE_NS  # for a source that is heard for the first time
        return soon and hearing.silent_ns(RADAR, now_ns) <= SILENCE_NS and not hearing.may_fall_silent(now_ns)

    def _take(self, record: Record) -> None:
        self._telling.begin(record)
        if isinstance(record, Raw):
            self.listener.take(record)
        elif isinstance(record, Tick):
            self._tick(record)
        elif isinstance(record, Status):
            self._status(record)
        else:
            self._telling.tell("host", "NOTE", record.text)

    def finish(self) -> list[Event]:
        """The sweep that is still open, and the summary of every counter."""
        if not self._telling.begun:
            return []
        self._read()
        self._judge(self._scans.finish())
        listener = self.listener
        counters = dict(self._counters)
        counters |= {"clock_restarts": listener.timebase.restarts, "radials_unlike_command": self._echo.unlike}
        if listener.chunks_of_unknown_adapter:
            counters["chunks_of_unknown_adapter"] = listener.chunks_of_unknown_adapter
        for name, link in listener.links.items():
            counters |= {f"{name}.{key}": value for key, value in link.all_counters().items()}
        self._telling.say(SummaryEvent(*self._telling.stamp, dict(sorted(counters.items()))))
        return self._telling.given()

    def _status(self, record: Status) -> None:
        self._counters[f"{record.adapter}.{record.state.lower()}"] += 1
        if record.state == "UP":
            self.listener.hearing.expect(record.adapter, record.stamp.monotonic_ns)
            if self._monitor:
                self.listener.hearing.expect(RADAR, record.stamp.monotonic_ns)
        if record.state in ("LOST", "BEHIND", "FAILED"):
            self._troubles[record.adapter] = f"degraded: {record.adapter} {record.state}: {record.reason}"
        self._telling.tell(record.adapter, record.state, record.reason)

    def _clock_began_anew(self, adapter: str, time_ns: int) -> None:
        """All older state is worthless."""
        self._judge(self._scans.finish())
        self.aircraft = Aircraft(self._config.monitor.height_source)
        if self._monitor:
            self._monitor.forget()
        self._echo.forget()
        reason = f"the bridge's clock began anew at {time_ns / 1e9:.3f} s; the state before it is dropped"
        self._troubles[f"clock of {adapter}"] = f"degraded: {adapter}: {reason}"
        self._telling.tell(adapter, "CLOCK_RESTARTED", reason)

    def _read(self) -> None:
        """Decode all that waits, and judge the scans that the radials complete."""
        scans = self._read_radials()
        self._read_words()
        self._judge(scans)

    def _read_sweep(self) -> None:
        """Decode the radials that wait; the aircraft's words too, if a scan has ended."""
        if scans := self._read_radials():
            self._read_words()
            self._judge(scans)

    def _read_words(self) -> None:
        listener = self.listener
        for (adapter, number), waiting in sorted(listener.words.items(), key=itemgetter(0)):
            words, link = waiting.take(), listener.links[adapter]
            if words is None:
                continue
            link.counters["malformed_bodies"] += words.malformed
            link.counters["words_429_unused"] += words.left_out
            if len(words.words):
                self._decode(link, f"{adapter}/{number}", waiting.channel, words)
        listener.words.clear()  # a channel may be another one from now on

    def _decode(self, link: Link, about: str, channel: Channel429, joined: Joined) -> None:
        values = arinc429.decode(joined.words, channel.definitions, channel.orientation)
        for status, count in enumerate(np.bincount(values.status).tolist()) if values.status.any() else ():
            if status and count:
                link.counters[f"words_429_{arinc429.Status(status).name.lower()}"] += count
        for finding in channel.health.feed(joined.time_ns, joined.words, values):
            state = "BUS_WRONG" if finding.wrong else "BUS_RIGHT"
            self._counters[f"{about}.{state.lower()}"] += 1
            self._telling.tell(about, state, finding.reason)
        if channel.is_panel:
            for k in np.flatnonzero(values.status == arinc429.Status.NORMAL):
                definition = channel.definitions.labels[int(values.label[k])]
                command = control708.decode(int(joined.words[k]), definition, self._echo.command)
                self._echo.feed_command(int(joined.sent_ns[k]), command)
        true_ns = joined.sent_ns - channel.delays_ns[values.label]
        some = channel.of_source(true_ns, joined.words, values)
        self.aircraft.feed(channel.definitions, *some, channel.join_rule)

    def _read_radials(self) -> list[Scan]:
        """The scans that the radials complete which wait."""
        radials = self.listener.radials.take()
        if radials is None:
            return []
        unpacked = arinc708.unpack(radials.words, radials.channel.profile)
        unusual = unpacked.unusual[unpacked.unusual > 0]
        for bit, name in enumerate(f.UNUSUAL_708):
            if count := int(np.count_nonzero(unusual >> bit & 1)):
                radials.link.counters[f"words_708_{name}"] += count
        self._compare_with_command(radials.link, radials.times_ns.tolist(), unpacked)
        return [*self._scans.feed(radials.times_ns, unpacked, radials.channel.profile.name)]

    def _compare_with_command(self, link: Link, times_ns: list[int], radials: Radials) -> None:
        if not self._echo.listens:
            return
        for k, time_ns in enumerate(times_ns):
            if finding := self._echo.feed_radial(time_ns, radials, k):
                link.counters[finding.state.lower()] += 1
                self._telling.tell(link.config.name, *finding)

    def _judge(self, scans: Iterable[Scan]) -> None:
        for scan in scans:
            self._telling.say(
                ScanEvent(
                    *self._telling.stamp,
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
            verdict, comparison = self._monitor.judge(scan, self.aircraft)
            for quantity, doubt in self.aircraft.doubts().items():
                if quantity not in self._owned_up:
                    self._owned_up.add(quantity)
                    self._troubles[quantity] = f"degraded: {quantity}: {doubt}"
            losses = [loss for link in self.listener.links.values() for loss in link.take_losses()]
            verdict = replace(verdict, reasons=(*verdict.reasons, *self._troubles.values(), *losses))
            self._troubles.clear()
            if self._watcher:
                self._watcher(scan, verdict, comparison)
            self._say(verdict, self._monitor)

    def _say(self, verdict: Verdict, monitor: Monitor) -> None:
        self._counters[f"verdicts_{verdict.verdict}"] += 1
        settings = monitor.settings
        event = IntegrityEvent(*self._telling.stamp, method=settings.method, p_fa=settings.p_fa, **vars(verdict))
        self._telling.say(event)

    def _tick(self, record: Tick) -> None:
        now_ns, hearing = record.stamp.monotonic_ns, self.listener.hearing
        silent = hearing.silent_ns(RADAR, now_ns) > SILENCE_NS
        if silent or not self.listener.patient:
            self._read()
        if silent:
            self._judge(self._scans.finish())
        for source, reason in hearing.fell_silent(now_ns):
            self._telling.tell(source, "QUIET", reason)
            if source == RADAR and self._monitor:
                self._say(self._monitor.unavailable(self._scans.skip(), [f"radar: {reason}"]), self._monitor)
        if self._tells_state:
            self._tell_doubts()
            self._telling.say(self._state(record))

    def _tell_doubts(self) -> None:
        for quantity, doubt in self.aircraft.doubts().items():
            if quantity not in self._doubted:
                self._doubted.add(quantity)
                self._telling.tell(quantity, "STATE_DOUBT", doubt)

    def _state(self, record: Tick) -> StateEvent:
        heard_ns = self.listener.now_host_ns
        silent_ns = 0 if heard_ns is None else record.stamp.monotonic_ns - heard_ns
        now_ns = self.listener.now_ns + silent_ns  # without words the state must still grow old
        values: dict[str, float | None] = {}
        validity: dict[str, str] = {}
        age_s: dict[str, float | None] = {}
        for name, track in self.aircraft.tracks.items():
            at = track.at(np.array([now_ns]))
            status = int(at.status[0])
            values[name] = float(at.value[0]) if status == 0 else None
            validity[name] = status_name(status)
            newest = track.newest
            age_s[name] = (now_ns - newest[0]) / 1e9 if newest else None
        utc = self.aircraft.utc.at(now_ns)
        values["utc_s"] = None if utc.utc_ns is None else utc.utc_ns / 1e9
        validity["utc_s"] = utc.validity
        return StateEvent(*self._telling.stamp, values, validity, age_s)
