"""The judged scans of a recording, each with the aircraft behind it: what exports of scans and verdicts begin with."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decoders.profiles import Profile
from gateway.config import profile_of
from gateway.core import Core
from gateway.events import Event, IntegrityEvent
from gateway.exports import Job
from gateway.metadata import recorded_monitor
from gateway.pipeline import Pipeline
from gateway.words import UtcLayer
from monitor.aircraft import Aircraft
from monitor.comparison import Comparison
from monitor.integrity import Monitor
from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.verdict import Verdict


class Judged(NamedTuple):
    """A scan, the UTC of its radials i8 (n,), its verdict, both threads if they were compared, and the aircraft.

    The aircraft is the pipeline's own, which goes on: ask it before the next scan.
    """

    scan: Scan
    utc_ns: NDArray[np.int64]
    verdict: Verdict
    comparison: Comparison | None
    aircraft: Aircraft
    profile: Profile  # of the radar


class WithoutTerrain(Monitor):
    """Says of every scan that nothing can be said."""

    def __init__(self, settings: MonitorSettings) -> None:
        self.settings = settings
        self.calibration = None
        self.water = None

    def judge(self, scan: Scan, aircraft: Aircraft) -> tuple[Verdict, Comparison | None]:  # noqa: ARG002 # as Monitor's
        """Unavailable."""
        return self.unavailable(scan.number, ["no terrain to compare with"]), None


def monitor_of(job: Job) -> Monitor:
    """The monitor that judges the scans. Raises GatewayError if its terrain is not there any more or has changed."""
    monitor = None if job.without_terrain else recorded_monitor(job.recording.metadata, job.config, job.terrain)
    return monitor or WithoutTerrain(job.config.monitor)


def judged(job: Job, monitor: Monitor) -> Iterator[Judged | IntegrityEvent]:
    """Each scan, and each verdict with the scan's behind it; a silent radar gives verdicts without scans.

    The UTC of radials is laid on as that of words is. A scan that ends with a bridge's clock is timed by the old one.
    """
    found: list[Judged | IntegrityEvent] = []
    pipelines: list[Pipeline] = []
    utc, offset_ns = UtcLayer(), 0

    def watch(scan: Scan, verdict: Verdict, comparison: Comparison | None) -> None:
        channel = pipelines[-1].listener.radials.channel
        profile = channel.profile if channel else profile_of(job.config.radar_profile)
        found.append(Judged(scan, scan.time_ns, verdict, comparison, pipelines[-1].aircraft, profile))

    def build(before: Pipeline | None) -> Pipeline:
        pipelines[:] = [Pipeline(job.config, monitor, watch, before)]
        return pipelines[-1]

    def emit(event: Event) -> None:
        if isinstance(event, IntegrityEvent):
            found.append(event)

    core = Core(build, emit, job.failures.append)
    for record in job.records():
        restarts = pipelines[-1].listener.timebase.restarts
        core.process(record)
        timebase = pipelines[-1].listener.timebase
        began_anew = timebase.restarts != restarts
        now_ns = utc.offset_ns("", timebase.host_offset_ns(), record.stamp) if timebase.heard else offset_ns
        yield from (_timed(item, offset_ns if began_anew else now_ns) for item in found)
        found.clear()
        offset_ns = now_ns
    core.finish()
    yield from (_timed(item, offset_ns) for item in found)


def _timed(item: Judged | IntegrityEvent, offset_ns: int) -> Judged | IntegrityEvent:
    return item._replace(utc_ns=item.utc_ns + offset_ns) if isinstance(item, Judged) else item
