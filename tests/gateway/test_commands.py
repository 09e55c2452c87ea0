"""From records to events: what the control panel asks, and whether the radar does it."""

from collections.abc import Iterable

from gateway.config import RackConfig
from gateway.events import StatusEvent
from gateway.pipeline import Pipeline
from simulators import arinc429, arinc708
from tests.gateway.made import (
    BINS,
    Bridge,
    counters,
    feed,
    only,
    radial,
    raw,
)

PANEL_CHANNEL = 5


def panel_rack(definitions: str = "wxr_panel", **monitor: float) -> RackConfig:
    channels = {PANEL_CHANNEL: {"kind": "arinc429", "definitions": definitions}}
    table = {"adapters": [{"name": "bridge", "source": "serial:x", "channels": channels}], "monitor": monitor}
    return RackConfig.model_validate(table)


def panel(bridge: Bridge, time_s: float, tilt_deg: float) -> bytes:
    """Both control words: stabilised, map, calibrated gain, 10 NM."""
    first = 1 << 2 | 2 << 3 | (round(tilt_deg * 4) & 0x7F) << 6 | 63 << 13
    words = [arinc429.encode(0o270, data=first), arinc429.encode(0o271, data=2 << 13)]
    return bridge.words(PANEL_CHANNEL, time_s, words)


def echoes(pipeline: Pipeline, tilts: Iterable[float]) -> list[StatusEvent]:
    """What is told of a panel that asks for each tilt for two seconds of a radar that stays at -2 deg and 10 NM."""
    bridge = Bridge()
    stream = bridge.hello()
    for k, tilt in enumerate(tilts):
        for tenth in range(20):
            time_s = 2.0 * k + tenth / 10
            stream += panel(bridge, time_s, tilt) + bridge.radar(time_s + 0.05, radial(tenth))
    return [event for event in only(StatusEvent, feed(pipeline, raw(1, 0, stream))) if "ECHO" in event.state]


def test_a_radar_that_does_not_do_what_its_panel_asks_is_told_once_and_counted() -> None:
    pipeline = Pipeline(panel_rack(), None)
    told = echoes(pipeline, [-2.0, 3.0, -2.0])
    assert [(event.adapter, event.state, event.reason) for event in told] == [
        ("bridge", "ECHO_MISMATCH", "tilt_deg: panel 3, radar -2"),
        ("bridge", "ECHO_AGREES", "the radar does what its panel asks"),
    ]
    found = counters(pipeline)
    assert found["bridge.echo_mismatch"] == 1
    assert found["radials_unlike_command"] == 10


def test_the_delay_that_a_radar_may_take_is_the_rack_s() -> None:
    assert not echoes(Pipeline(panel_rack(control_delay_s=3.0), None), [3.0, 4.0])
    pipeline = Pipeline(panel_rack(control_delay_s=0.0), None)
    assert len(echoes(pipeline, [3.0])) == 1
    assert counters(pipeline)["radials_unlike_command"] == 20


def test_a_radar_that_comes_round_to_its_panel_is_told() -> None:
    bridge, pipeline = Bridge(), Pipeline(panel_rack(), None)
    stream = bridge.hello() + panel(bridge, 0.0, 3.0) + bridge.radar(1.5, radial(0))
    other = arinc708.encode(BINS, scan_angle_deg=1.0, tilt_deg=3.0, range_nm=10.0)
    events = feed(pipeline, raw(1, 0, stream + bridge.radar(2.0, other)))
    assert [event.state for event in only(StatusEvent, events)] == ["ECHO_MISMATCH", "ECHO_AGREES"]


def test_control_words_that_are_not_normal_ask_for_nothing() -> None:
    bridge, pipeline = Bridge(), Pipeline(panel_rack(), None)
    bad = [
        arinc429.encode(0o270, data=0, ssm=1),
        arinc429.encode(0o270, data=0) ^ 1 << 31,
        arinc429.encode(0o200, data=0),
    ]
    stream = bridge.hello() + bridge.words(PANEL_CHANNEL, 0.0, bad) + bridge.radar(2.0, radial(0))
    assert not only(StatusEvent, feed(pipeline, raw(1, 0, stream)))
    assert counters(pipeline)["radials_unlike_command"] == 0


def test_a_command_of_before_the_clock_restarted_is_forgotten() -> None:
    bridge, pipeline = Bridge(), Pipeline(panel_rack(), None)
    stream = bridge.hello(100) + panel(bridge, 100.0, 3.0) + bridge.radar(0.1, radial(0)) + bridge.radar(1.6, radial(1))
    told = only(StatusEvent, feed(pipeline, raw(1, 0, stream)))
    assert [event.state for event in told] == ["CLOCK_RESTARTED"]
