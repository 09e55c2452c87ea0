"""From records to events: what is said of sources that fall silent, and of a state that grows old."""

import pytest

from decoders import formats as f
from gateway.events import Event, IntegrityEvent, ScanEvent, StateEvent, StatusEvent
from gateway.pipeline import Pipeline
from monitor.integrity import Monitor
from monitor.terrain import open_terrain
from simulators import racklink
from tests.gateway.conftest import TERRAIN
from tests.gateway.made import GNSS, IRU, RACK, Bridge, counters, feed, only, position, raw, status, sweep, tick


@pytest.fixture(scope="module")
def monitor() -> Monitor:
    return Monitor(open_terrain(TERRAIN))


def test_a_source_that_falls_quiet_is_told_once_and_again_when_it_is_heard() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    feed(pipeline, raw(1, 0, bridge.heartbeat(0)))
    events = feed(pipeline, *(tick(k + 2, k + 1.0) for k in range(8)), raw(20, 9.5, bridge.heartbeat(9)))
    told = [(event.state, event.sequence, event.reason) for event in only(StatusEvent, events)]
    assert told == [("QUIET", 7, "no packets for 6.0 s"), ("HEARD", 20, "packets come again")]


def test_a_source_that_was_opened_and_never_heard_is_told_to_be_quiet() -> None:
    pipeline = Pipeline(RACK, None)
    events = feed(pipeline, status(0, 0, "UP"), *(tick(k, k) for k in range(1, 9)))
    assert [event.adapter for event in only(StatusEvent, events) if event.state == "QUIET"] == ["bridge"]


def test_a_line_that_gives_bytes_but_no_packets_is_told_to_be_quiet_with_what_to_check() -> None:
    pipeline = Pipeline(RACK, None)
    noise = (raw(2 * k, k + 0.5, bytes([0x5A, 0, 0xFF, 0]) * 20) for k in range(1, 9))
    records = [record for k, chunk in enumerate(noise) for record in (tick(2 * k + 1, k + 1.0), chunk)]
    events = feed(pipeline, status(0, 0, "UP"), *records)
    (told,) = [event.reason for event in only(StatusEvent, events) if event.state == "QUIET"]
    assert "though bytes come: check the baud rate" in told


def test_a_silent_radar_ends_its_sweep_and_gives_an_unavailable_verdict(monitor: Monitor) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, monitor)
    feed(pipeline, raw(1, 0, bridge.hello() + sweep(bridge, 0, turn=False)))
    events: list[Event] = []
    for second in range(1, 8):
        events += feed(pipeline, raw(2 * second, second, bridge.heartbeat(second)), tick(2 * second + 1, second + 0.1))
    silent = [event.adapter for event in only(StatusEvent, events)]
    assert sorted(silent) == ["bridge/1", "bridge/2", "radar"]  # the hello has announced them all
    assert len(only(ScanEvent, events)) == 1
    sweep_verdict, silence = only(IntegrityEvent, events)
    assert silence.scan == sweep_verdict.scan + 1
    assert silence.verdict == "unavailable"
    assert any("no words for" in reason for reason in silence.reasons)


def test_the_state_grows_old_when_words_stop_though_the_bridge_still_beats() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = b"".join(bridge.words(GNSS, 0.2 * k, position()) for k in range(5))
    feed(pipeline, raw(1, 1, bridge.hello() + words))
    events: list[Event] = []
    for second in range(2, 9):
        events += feed(pipeline, raw(2 * second, second, bridge.heartbeat(second)), tick(2 * second + 1, second + 0.1))
    states = only(StateEvent, events)
    assert states[0].validity["latitude_deg"] == "NORMAL"
    assert states[-1].validity["latitude_deg"] == "STALE"
    ages = [state.age_s["latitude_deg"] for state in states]
    assert ages == [pytest.approx(1.1 + k, abs=0.01) for k in range(7)]


def test_a_radar_that_is_never_heard_is_unavailable(monitor: Monitor) -> None:
    pipeline = Pipeline(RACK, monitor)
    events = feed(pipeline, status(0, 0, "UP"), *(tick(k, k) for k in range(1, 9)))
    (verdict,) = only(IntegrityEvent, events)
    assert verdict.verdict == "unavailable"
    assert "radar: no words" in verdict.reasons[0]


def test_another_channel_takes_over_once_the_one_in_use_is_silent() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    other = IRU + 7
    said = bridge.hello() + bridge.hello(body=racklink.hello(1, 1, [(other, f.KIND_429_HIGH, 0, 4)]))
    feed(pipeline, raw(0, 0, said + bridge.words(IRU, 0.1, [0]) + bridge.words(other, 0.2, [0])))
    feed(pipeline, raw(1, 10, bridge.words(other, 10.2, [0])))
    assert counters(pipeline)["bridge.words_429_unused"] == 1


def test_a_channel_that_falls_silent_is_told_although_its_bridge_goes_on() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    feed(pipeline, raw(1, 0, bridge.hello() + bridge.words(GNSS, 0, position())))
    records = [record for k in range(1, 9) for record in (raw(2 * k, k, bridge.heartbeat(k)), tick(2 * k + 1, k + 0.1))]
    told = [event for event in only(StatusEvent, feed(pipeline, *records)) if event.state == "QUIET"]
    found = sorted((event.adapter, event.reason) for event in told)
    assert found == [(source, "no words for 5.1 s") for source in ("bridge/1", "bridge/2", "radar")]
