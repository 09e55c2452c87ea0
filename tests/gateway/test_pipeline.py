"""From records to events: what is used, what is refused and counted, and what is said of silence and loss."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from decoders import formats as f
from gateway.config import RackConfig, check_config
from gateway.errors import GatewayError
from gateway.events import IntegrityEvent, ScanEvent, StateEvent, StatusEvent, SummaryEvent
from gateway.pipeline import Pipeline
from gateway.records import Note, Record
from monitor.integrity import Monitor
from monitor.terrain import open_terrain
from simulators import arinc429, arinc708, racklink
from tests.decoders.bus import word429
from tests.gateway.conftest import TERRAIN
from tests.gateway.made import (
    BINS,
    GNSS,
    IRU,
    RACK,
    RADAR,
    Bridge,
    counters,
    feed,
    only,
    position,
    radial,
    raw,
    stamp,
    status,
    sweep,
    tick,
)


@pytest.fixture(scope="module")
def monitor() -> Monitor:
    return Monitor(open_terrain(TERRAIN))


def test_statuses_and_notes_become_events_of_their_record() -> None:
    events = feed(Pipeline(RACK, None), status(4, 1.5, "LOST", "why"), Note(5, stamp(2), "stepped"))
    assert events == [
        StatusEvent(stamp(1.5).utc_ns, 4, "bridge", "LOST", "why"),
        StatusEvent(stamp(2).utc_ns, 5, "host", "NOTE", "stepped"),
    ]


def test_a_sweep_becomes_a_scan_of_the_record_that_ended_it() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    events = feed(pipeline, raw(1, 0, bridge.hello()), raw(2, 0.5, sweep(bridge, 0, turn=False)))
    assert events == []
    (scan,) = feed(pipeline, raw(3, 0.6, bridge.radar(0.55, radial(-15))))
    assert scan == ScanEvent(
        stamp(0.6).utc_ns,
        3,
        scan=0,
        radials=10,
        sector=(pytest.approx(-15, abs=0.05), pytest.approx(12, abs=0.05)),  # type: ignore[arg-type]
        range_nm=10.0,
        tilt_deg=-2.0,
        gaps=0,
        repeated=0,
        cut_off=0,
    )


def test_the_open_sweep_is_given_at_the_end_with_the_summary() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    feed(pipeline, raw(1, 0, bridge.hello() + sweep(bridge, 0, turn=False)))
    scan, summary = pipeline.finish()
    assert isinstance(scan, ScanEvent)
    assert isinstance(summary, SummaryEvent)
    assert summary.counters["bridge.words_708"] == 10


def test_nothing_recorded_gives_nothing() -> None:
    assert list(Pipeline(RACK, None).finish()) == []


@pytest.mark.parametrize("flag", [f.FLAG_CODING, f.FLAG_WORD_LENGTH, f.FLAG_SYNC])
def test_words_whose_bits_cannot_be_trusted_are_refused_and_counted(flag: int) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    spoilt = bridge.words(GNSS, 0.1, position(), flag) + bridge.radar(0.2, radial(0), flag)
    events = feed(pipeline, raw(1, 0, bridge.hello() + spoilt), tick(2, 0.3))
    assert only(StateEvent, events)[0].validity["latitude_deg"] == "MISSING"
    found = counters(pipeline)
    assert (found["bridge.words_429_unused"], found["bridge.words_708_unused"]) == (4, 1)


@pytest.mark.parametrize("flag", [0, f.FLAG_PARITY, f.FLAG_FIFO_OVERFLOW])
def test_words_with_other_flags_are_used(flag: int) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = b"".join(bridge.words(GNSS, 0.2 * k, position(), flag) for k in range(2))
    (state,) = only(StateEvent, feed(pipeline, raw(1, 0, bridge.hello() + words), tick(2, 0.3)))
    assert state.validity["latitude_deg"] == "NORMAL"
    assert state.values["latitude_deg"] == pytest.approx(44.4, abs=1e-6)
    assert state.values["longitude_deg"] == pytest.approx(-71.7, abs=1e-6)


def test_unknown_packet_types_and_versions_are_counted() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    assert feed(pipeline, raw(1, 0, bridge.packet(0x7F, 0, 0, b"new") + bridge.heartbeat(1))) == []
    found = counters(pipeline)
    assert (found["bridge.packets"], found["bridge.packets_of_unknown_type"]) == (2, 1)


def test_malformed_bodies_are_counted_and_cost_no_neighbour() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    malformed = (
        bridge.packet(f.HELLO, 0, 0, b"abc")
        + bridge.packet(f.HEARTBEAT, 0, 0, b"abc")
        + bridge.packet(f.WORD_708, RADAR, 0, b"\x40\x06short")
        + bridge.packet(f.WORDS_429, GNSS, 0, b"\0" * 11)
        + bridge.packet(f.WORD_708, RADAR, 2**64 / 1e9 - 1e4, b"\0\0")
    )
    feed(pipeline, raw(1, 0, bridge.hello() + malformed + bridge.radar(0.1, radial(0))))
    found = counters(pipeline)
    assert found["bridge.malformed_bodies"] == 5
    assert found["bridge.words_708"] == 1


@pytest.mark.parametrize(
    ("bits", "kind"), [(800, "short"), (0, "short"), (1599, "short"), (1601, "long"), (2047, "long")]
)
def test_a_radar_word_of_another_length_is_counted_by_kind_and_not_used(bits: int, kind: str) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    word = bridge.packet(f.WORD_708, RADAR, 0, bits.to_bytes(2, "little") + bytes((bits + 7) // 8))
    feed(pipeline, raw(1, 0, bridge.hello() + word))
    found = {name: count for name, count in counters(pipeline).items() if name.startswith("bridge.words_708") and count}
    assert found == {"bridge.words_708": 1, "bridge.words_708_unused": 1, f"bridge.words_708_{kind}": 1}


def test_what_is_unusual_in_a_radar_word_is_counted_by_name_and_the_word_is_used() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    plain = radial(0)
    odd = bytearray(arinc708.encode(BINS * 5, scan_angle_deg=3.0, tilt_deg=-2.0, range_nm=10.0, label=0o050, mode=7))
    for bit in (11, 48, 63):
        odd[bit // 8] |= 1 << bit % 8
    words = bridge.radar(0.1, plain) + bridge.radar(0.2, bytes(odd)) + bridge.radar(0.3, plain)
    feed(pipeline, raw(1, 0, bridge.hello() + words))
    found = counters(pipeline)
    names = ("unknown_label", "reserved_mode", "spare_11_12", "spare_48", "spare_63", "reserved_level")
    assert names == f.UNUSUAL_708
    assert [found[f"bridge.words_708_{name}"] for name in names] == [1] * 6
    assert (found["bridge.words_708"], found.get("bridge.words_708_unused", 0)) == (3, 0)


def test_a_chunk_of_an_adapter_that_is_not_configured_is_counted() -> None:
    pipeline = Pipeline(RACK, None)
    feed(pipeline, raw(1, 0, b"x", adapter="other"))
    assert counters(pipeline)["chunks_of_unknown_adapter"] == 1


def test_words_of_a_channel_that_nobody_named_are_counted_and_told_once() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = [raw(k, k / 10, bridge.words(9, k / 10, position())) for k in range(3)]
    told = only(StatusEvent, feed(pipeline, *words))
    assert [(event.state, event.sequence) for event in told] == [("UNUSED_CHANNEL", 0)]
    assert "channel 9" in told[0].reason
    assert counters(pipeline)["bridge.words_429_unused"] == 12


def test_a_second_radar_is_recorded_and_told_but_never_mixed_with_the_first() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    other = RADAR + 7
    said = bridge.hello() + bridge.hello(body=racklink.hello(1, 1, [(other, f.KIND_708, 0, 0)]))
    word = bridge.radar(0.1, radial(0))
    stream = said + word + bridge.packet(f.WORD_708, other, 0.2, racklink.word_708(radial(0)))
    (told,) = only(StatusEvent, feed(pipeline, raw(0, 0, stream)))
    assert told.state == "UNUSED_CHANNEL"
    assert "the radar in use" in told.reason
    assert counters(pipeline)["bridge.words_708_unused"] == 1


def test_a_gnss_without_computed_data_says_so_and_gives_no_value() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = b"".join(bridge.words(GNSS, 0.2 * k, position(ssm=1)) for k in range(3))
    (state,) = only(StateEvent, feed(pipeline, raw(1, 0, bridge.hello() + words), tick(2, 0.5)))
    assert state.values["latitude_deg"] is None
    assert state.validity["latitude_deg"] == "NO_COMPUTED_DATA"
    assert counters(pipeline)["bridge.words_429_no_computed_data"] == 12


def test_a_scan_without_gnss_is_unavailable_and_the_reason_names_what_is_missing(monitor: Monitor) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, monitor)
    words = b"".join(bridge.words(GNSS, 0.2 * k, position(ssm=1)) for k in range(5))
    events = feed(pipeline, raw(1, 0, bridge.hello() + words + sweep(bridge, 0.1)))
    (verdict,) = only(IntegrityEvent, events)
    assert verdict.verdict == "unavailable"
    assert any("latitude_deg: NO_COMPUTED_DATA" in reason for reason in verdict.reasons)
    assert any("pitch_deg: MISSING" in reason for reason in verdict.reasons)
    assert verdict.q is None


def test_losses_appear_in_the_next_verdict_and_in_no_other(monitor: Monitor) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, monitor)
    feed(pipeline, raw(1, 0, bridge.hello(), dropped=17), status(2, 0.1, "LOST", "unplugged"))
    bridge.sequence += 5
    first = feed(pipeline, raw(3, 0.5, sweep(bridge, 0)))
    second = feed(pipeline, raw(4, 1.5, sweep(bridge, 1)))
    (verdict,) = only(IntegrityEvent, first)
    assert [reason for reason in verdict.reasons if "degraded" in reason] == [
        "degraded: bridge LOST: unplugged",
        "degraded: bridge: 17 bytes dropped",
        "degraded: bridge: 5 packets lost",
    ]
    assert not [reason for event in only(IntegrityEvent, second) for reason in event.reasons if "degraded" in reason]


def test_inertial_words_give_attitude_in_degrees() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = [arinc429.encode(0o324, -2.5), arinc429.encode(0o325, 10.0), arinc429.encode(0o314, 197.6 - 360)]
    data = b"".join(bridge.words(IRU, 0.02 * k, words) for k in range(3))
    (state,) = only(StateEvent, feed(pipeline, raw(1, 0, bridge.hello() + data), tick(2, 0.05)))
    found = [state.values[name] for name in ("pitch_deg", "roll_deg", "heading_deg")]
    assert found == [pytest.approx(value, abs=0.01) for value in (-2.5, 10.0, -162.4)]


def test_channels_of_the_configuration_need_no_hello() -> None:
    channels = {"1": {"kind": "arinc429", "definitions": "gnss_743a"}, "0": {"kind": "arinc708"}}
    rack = RackConfig.model_validate({"adapters": [{"name": "bridge", "source": "serial:x", "channels": channels}]})
    bridge, pipeline = Bridge(), Pipeline(rack, None)
    words = b"".join(bridge.words(GNSS, 0.2 * k, position()) for k in range(2))
    events = feed(pipeline, raw(1, 0, words + sweep(bridge, 0)), tick(2, 0.3))
    assert only(StateEvent, events)[0].validity["latitude_deg"] == "NORMAL"
    assert len(only(ScanEvent, events)) == 1


def test_a_bridge_that_starts_anew_takes_the_state_before_it_along() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = b"".join(bridge.words(GNSS, 100 + 0.2 * k, position()) for k in range(3))
    (known,) = only(StateEvent, feed(pipeline, raw(1, 0, bridge.hello(100) + words), tick(2, 0.1)))
    assert known.validity["latitude_deg"] == "NORMAL"
    told = feed(pipeline, raw(3, 0.2, bridge.words(IRU, 0.0, [0])), tick(4, 0.3))
    assert [event.state for event in only(StatusEvent, told)] == ["CLOCK_RESTARTED"]
    (state,) = only(StateEvent, told)
    assert state.validity["latitude_deg"] == "MISSING"


def test_a_spoilt_word_does_not_make_its_channel_the_radar_in_use() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    other = RADAR + 7
    said = bridge.hello() + bridge.hello(body=racklink.hello(1, 1, [(other, f.KIND_708, 0, 0)]))
    spoilt = bridge.packet(f.WORD_708, other, 0.1, racklink.word_708(radial(0)), f.FLAG_CODING)
    feed(pipeline, raw(0, 0, said + spoilt + bridge.radar(0.2, radial(0))))
    assert counters(pipeline)["bridge.words_708_unused"] == 1


def test_words_that_run_backwards_inside_a_packet_are_counted_and_not_used() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    words = bridge.packet(f.WORDS_429, IRU, 0.1, racklink.words_429([9, 3], [0, 0]))
    feed(pipeline, raw(0, 0, bridge.hello() + words))
    found = counters(pipeline)
    assert (found["bridge.malformed_bodies"], found["bridge.words_429_unused"]) == (1, 2)


def test_a_channel_without_an_announcement_is_identified_by_label_377_and_then_used() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    equipment = word429(0o377, {11: (0x00B, 12)})
    events = feed(
        pipeline, *(raw(k, k, bridge.words(5, k, [equipment, *position()])) for k in range(1, 5)), tick(9, 4.1)
    )
    (told,) = [event for event in only(StatusEvent, events) if event.state == "IDENTIFIED"]
    assert told.reason == "label 377 says what channel 5 is: read as gnss_743a from now on"
    (state,) = only(StateEvent, events)
    assert state.validity["latitude_deg"] == "NORMAL"


def test_a_delay_moves_the_time_at_which_a_value_was_true() -> None:
    """Pitch rises one LSB a millisecond; 20 ms of delay are 20 LSB."""
    seen = []
    for delay_ms in (0, 20):
        channels = {IRU: {"kind": "arinc429", "definitions": "iru_704", "delays_ms": {"324": delay_ms}}}
        rack = check_config({"adapters": [{"name": "bridge", "source": "serial:x", "channels": channels}]}, "test")
        bridge, pipeline = Bridge(), Pipeline(rack, None)
        packets = [bridge.words(IRU, k / 1000, [word429(0o324, {15: (k, 15)}, ssm=3)]) for k in range(0, 200, 10)]
        (state,) = only(StateEvent, feed(pipeline, raw(1, 0.19, b"".join(packets)), tick(2, 0.19)))
        seen.append(state.values["pitch_deg"])
    assert seen[0] is not None
    assert seen[1] is not None
    assert (seen[1] - seen[0]) / (180 / 2**14) == pytest.approx(20)


def test_findings_about_a_bus_are_events_and_counted() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    pitch = word429(0o324, {}, ssm=3)
    packets = [bridge.words(IRU, k / 250, [pitch]) for k in range(500)]
    events = feed(pipeline, raw(1, 0, bridge.hello() + b"".join(packets)), tick(2, 2.0))
    (told,) = [event for event in only(StatusEvent, events) if event.state == "BUS_WRONG"]
    assert (told.adapter, told.reason) == ("bridge/2", "label 324 comes every 4.0 ms, 10 is the shortest interval")
    assert counters(pipeline)["bridge/2.bus_wrong"] == 1
    assert counters(pipeline)["bridge.channel_2.peak_words_per_s"] == 250


def test_a_position_joined_by_the_wrong_rule_is_told_and_degrades_the_next_verdict(monitor: Monitor) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, monitor)
    records: list[Record] = [raw(0, 0, bridge.hello())]
    for k in range(30):
        steps = round((44.0 + 9e-4 * k) * 2**31 / 180)  # flying north, in the south, by a box that counts from zero
        coarse, fine = divmod(steps, 2048)
        words = [word429(0o110, {9: (-coarse & 0x1FFFFF, 21)}, 3), word429(0o120, {18: (fine, 11)}, 3)]
        records += [raw(2 * k + 1, k, bridge.words(GNSS, k, words)), tick(2 * k + 2, k + 0.5)]
    (told,) = [event for event in only(StatusEvent, feed(pipeline, *records)) if event.state == "STATE_DOUBT"]
    assert told.adapter == "latitude_deg"
    assert "set join_rule of the channel" in told.reason
    (verdict,) = only(IntegrityEvent, feed(pipeline, raw(99, 30, sweep(bridge, 30))))
    assert any(reason.startswith("degraded: latitude_deg: joined by") for reason in verdict.reasons)


def test_the_state_tells_utc_as_the_receiver_has_it() -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, None)
    date = word429(0o260, {24: (1, 4), 19: (6, 4), 15: (2, 4), 11: (6, 4)})
    stream = bridge.hello()
    for second in range(2):
        time = word429(0o150, {24: (12, 5), 12: (second, 6), 11: (1, 1)}, ssm=3)
        stream += bridge.words(GNSS, 5 + second, [date, time])
    (state,) = only(StateEvent, feed(pipeline, raw(1, 0, stream), tick(2, 2.0)))
    assert state.values["utc_s"] == datetime(2026, 6, 1, 12, 0, 3, tzinfo=UTC).timestamp()
    assert state.validity["utc_s"] == "NORMAL"


def test_units_that_the_state_cannot_convert_are_told_and_break_nothing(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(
        "[mine]\nequipment_id = 0x00B\nrows = [{ label = '076', name = 'Height', encoding = 'bnr', bits = [9, 28], "
        "range = 131072, lsb = 0.125, units = 'feet', source = 's', confidence = 'c' },"
        " { label = '150', name = 'UTC', encoding = 'time', source = 's', confidence = 'c' }]"
    )
    channels = {GNSS: {"kind": "arinc429", "definitions": str(tmp_path / "mine.toml")}}
    rack = check_config({"adapters": [{"name": "bridge", "source": "serial:x", "channels": channels}]}, "test")
    bridge, pipeline = Bridge(), Pipeline(rack, None)
    words = [word429(0o076, {9: (800, 21)}, ssm=3), word429(0o150, {}, ssm=3)]
    events = feed(pipeline, raw(1, 0, bridge.words(GNSS, 0, words)), tick(2, 1.0))
    (told,) = [event for event in only(StatusEvent, events) if event.state == "STATE_DOUBT"]
    assert (told.adapter, told.reason[:31]) == ("height_m", "label 076 of mine is in 'feet':")


@pytest.mark.parametrize("name", ["radar", "core", "host", "journal"])
def test_no_adapter_can_be_named_like_a_part_of_the_gateway(name: str) -> None:
    with pytest.raises(GatewayError, match="choose another name"):
        check_config({"adapters": [{"name": name, "source": "serial:x"}]}, "test")


def test_of_several_sources_on_one_bus_the_configured_one_is_used() -> None:
    channels = {IRU: {"kind": "arinc429", "definitions": "iru_704", "sdi": 2}}
    rack = check_config({"adapters": [{"name": "bridge", "source": "serial:x", "channels": channels}]}, "test")
    bridge, pipeline = Bridge(), Pipeline(rack, None)
    pitch = [word429(0o324, {9: (sdi, 2), 15: (1000 * sdi, 15)}, ssm=3) for sdi in (1, 2, 3)]
    packets = [bridge.words(IRU, k / 50, pitch) for k in range(5)]
    (state,) = only(StateEvent, feed(pipeline, raw(1, 0.08, b"".join(packets)), tick(2, 0.08)))
    assert state.values["pitch_deg"] == 2000 * 180 / 2**14


def test_of_several_sources_that_nobody_chose_the_first_is_used_and_the_next_verdict_says_so(monitor: Monitor) -> None:
    bridge, pipeline = Bridge(), Pipeline(RACK, monitor)
    pitch = [word429(0o324, {9: (sdi, 2), 15: (1000 * sdi, 15)}, ssm=3) for sdi in (1, 2, 3)]
    packets = [bridge.hello(), *(bridge.words(IRU, k / 50, pitch) for k in range(5))]
    events = [*feed(pipeline, raw(1, 0.08, b"".join(packets)), tick(2, 0.08))]
    (state,) = only(StateEvent, events)
    assert state.values["pitch_deg"] == 1000 * 180 / 2**14
    (told,) = [event for event in only(StatusEvent, events) if event.state == "STATE_DOUBT"]
    assert told.reason.startswith("words of SDI 2, 3 are left out")
    (verdict,) = only(IntegrityEvent, feed(pipeline, raw(3, 1, sweep(bridge, 1))))
    assert any(reason.startswith("degraded: SDI 1 of equipment 04: words of SDI 2, 3") for reason in verdict.reasons)
