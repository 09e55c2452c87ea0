"""Shadows tracked through the pipeline: a simulated flight keeps them, and no recording lends another its scans."""

from math import radians

from gateway.events import IntegrityEvent
from gateway.metadata import recorded_config, recorded_monitor
from gateway.pipeline import Pipeline
from gateway.recording import Recording
from tests.golden.make import HERE, TERRAIN

TOP = HERE.parent.parent


def test_a_flight_s_shadows_hold_from_scan_to_scan_and_each_recording_begins_anew() -> None:
    recording = Recording(HERE / "format2.mcap")
    recorded = recorded_config(recording.metadata)
    plain = recorded_monitor(recording.metadata, recorded, (TOP / TERRAIN,))
    wide_m = 10 * 1852 * radians(3.0) / 2  # its radials are 3 degrees apart: at 10 NM no crest is farther from one
    settings = recorded.monitor.model_copy(update={"tracked_scans": 2, "tracking_tolerance_m": wide_m})
    config = recorded.model_copy(update={"monitor": settings})
    monitor = recorded_monitor(recording.metadata, config, (TOP / TERRAIN,))
    assert monitor and plain
    found: list[list[IntegrityEvent]] = []
    for judging in (plain, monitor, monitor):
        pipeline = Pipeline(config, judging)
        events = [event for record in recording for event in pipeline.feed(record)] + pipeline.finish()
        found.append([event for event in events if isinstance(event, IntegrityEvent)])
    untracked, tracked, again = found
    assert tracked == again
    first, second = tracked[:2]
    assert (first.verdict, first.n_pairs) == ("unavailable", 0)
    assert any(
        "0 terrain shadows do not count: no front there in each of 1 scans before, of which there are 0" in reason
        for reason in first.reasons
    )
    assert second.verdict == untracked[1].verdict == "ok"
    assert 0.9 * untracked[1].n_pairs <= second.n_pairs <= untracked[1].n_pairs
    assert monitor.anew()._tracker.before(0) == monitor._tracker.before(0) == ()
    assert not monitor._tracker._before, "the pipeline's scans stay with the pipeline"
