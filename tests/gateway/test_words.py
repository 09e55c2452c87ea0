"""The words of a recording in blocks: their UTC, whose they are, and what is left out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders import formats as f
from gateway.config import check_config
from gateway.errors import GatewayError
from gateway.records import Raw, Record, Stamp
from gateway.text import Wanted, lines
from gateway.words import STEP_NS, Block429, Item, Malformed, Word708, WordStage
from tests.gateway.made import GNSS, IRU, RACK, RADAR, SECOND_NS, UTC_NS, Bridge, position, radial, raw

MS = 1_000_000
TWO = check_config({"adapters": [{"name": name, "source": "serial:x"} for name in ("a", "b")]}, "test")


def items(*records: Record, rack: object = RACK) -> list[Item]:
    stage = WordStage(rack)  # type: ignore[arg-type]
    return [item for record in records for item in stage.feed(record)]


def blocks(found: list[Item]) -> list[Block429]:
    return [item for item in found if isinstance(item, Block429)]


def read(
    sequence: int, device_s: float, delay_ms: float, data: bytes, adapter: str = "bridge", utc_step_s: float = 0.0
) -> Raw:
    """A record read so long after the word's device time; the host had been up for 50 s when that clock began."""
    ns = round(device_s * SECOND_NS) + round(delay_ms * MS)
    return Raw(sequence, Stamp(50 * SECOND_NS + ns, UTC_NS + ns + round(utc_step_s * SECOND_NS)), adapter, data)


def test_words_of_a_bridge_lie_as_far_apart_in_utc_as_by_its_own_clock_whatever_the_jitter() -> None:
    bridge = Bridge()
    delays_ms = 1 + np.random.default_rng(1).uniform(0, 4.9, 200)
    records = [read(k, 0.1 * k, delay, bridge.words(IRU, 0.1 * k, [1])) for k, delay in enumerate(delays_ms.tolist())]
    found = blocks(items(*records))
    ahead = {int(block.utc_ns[0] - block.device_ns[0]) - UTC_NS for block in found}
    assert ahead == {round(delays_ms[0] * MS)}  # the first is held, since no later delay is STEP_NS smaller


def test_what_was_read_late_at_first_moves_to_the_smaller_delay_in_one_step() -> None:
    bridge = Bridge()
    delays_ms = [800.0, 2.0, 3.0, 1.0]
    records = [read(k, k, delay, bridge.words(IRU, k, [1])) for k, delay in enumerate(delays_ms)]
    late = [int(block.utc_ns[0] - block.device_ns[0]) - UTC_NS for block in blocks(items(*records))]
    assert late == [800 * MS, 2 * MS, 2 * MS, 2 * MS]


def test_drifting_clocks_are_followed_in_steps() -> None:
    bridge = Bridge()
    records = [read(k, k * (1 + 5e-5), 1.0, bridge.words(IRU, float(k), [1])) for k in range(0, 900, 3)]
    found = blocks(items(*records))
    off_ns = np.array([block.utc_ns[0] - record.stamp.utc_ns for block, record in zip(found, records, strict=True)])
    assert np.abs(off_ns).max() <= STEP_NS
    # 0.15 ms from word to word, so a step each 5.1 ms of the 44.85 ms that the clocks drift apart
    assert len(np.unique([block.utc_ns[0] - block.device_ns[0] for block in found])) == 1 + int(44.85 / 5.1)


def test_a_step_of_the_host_s_utc_is_followed_at_once() -> None:
    bridge = Bridge()
    records = [read(k, k, 1.0, bridge.words(IRU, k, [1]), utc_step_s=3600.0 * (k > 1)) for k in range(4)]
    found = [int(block.utc_ns[0]) - UTC_NS - MS for block in blocks(items(*records))]
    assert found == [0, SECOND_NS, 3602 * SECOND_NS, 3603 * SECOND_NS]


def test_words_of_two_bridges_with_clocks_of_their_own_meet_in_utc() -> None:
    one, other = Bridge(), Bridge()
    records: list[Record] = []
    for k in range(10):
        records.append(read(2 * k, k, 1.0, one.words(IRU, k, [1]), "a"))
        records.append(read(2 * k + 1, k, 2.0, other.words(IRU, k + 1000.0, [2]), "b"))
    utc_ns = [int(block.utc_ns[0]) for block in blocks(items(*records, rack=TWO))]
    assert np.diff(utc_ns)[::2].tolist() == [1 * MS] * 10  # the difference of the delays, which nobody can see


def test_a_bridge_s_clock_that_began_anew_keeps_the_utc_of_its_words() -> None:
    bridge = Bridge()
    records = [read(k, k, 1.0, bridge.words(IRU, device_s, [1])) for k, device_s in enumerate([100.0, 101.0, 0.5, 1.5])]
    utc_ns = [int(block.utc_ns[0]) for block in blocks(items(*records))]
    assert np.diff(utc_ns).tolist() == [SECOND_NS] * 3


def test_each_word_says_whose_it_is_and_how_it_is_read() -> None:
    bridge = Bridge()
    sent = (
        bridge.words(9, 0.5, [5])
        + bridge.hello()
        + bridge.words(GNSS, 1.0, position())
        + bridge.radar(1.5, radial(3.0))
    )
    unknown, gnss, radar = items(raw(0, 2.0, sent))
    assert isinstance(unknown, Block429)
    assert (unknown.channel, unknown.reading, unknown.decoded()) == (9, None, None)
    assert isinstance(gnss, Block429)
    assert gnss.reading
    assert (gnss.adapter, gnss.channel, gnss.reading.definitions.name) == ("bridge", GNSS, "gnss_743a")
    assert isinstance(radar, Word708)
    assert radar.reading
    assert (radar.channel, radar.bit_count, radar.reading.profile.name, radar.data) == (
        RADAR,
        1600,
        "arinc708",
        radial(3.0),
    )


def test_what_became_no_word_is_counted_by_what_it_is() -> None:
    bridge, stage = Bridge(), WordStage(RACK)
    twice = bridge.words(IRU, 1.0, [1])
    bad = bridge.packet(f.WORD_708, RADAR, 1.1, b"\xff\xff")
    ages = bridge.packet(f.WORD_708, RADAR, 2**34, b"\x00\x00")
    found = list(stage.feed(raw(0, 2.0, twice + twice + b"garbage\0" + bad + ages)))
    assert [type(item) for item in found] == [Block429, Malformed, Malformed]
    assert stage.left_out() == {
        "bytes of bridge that are no packet": len(b"garbage\0"),
        "packets of bridge that contradict their type": 2,
        "packets of bridge that came twice": 1,
    }


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["a", "b"]),
            st.integers(0, 2**64 - 1),
            st.integers(0, 2**64 - 1),
            st.integers(0, 2**64 - 1),
            st.sampled_from([f.WORDS_429, f.WORD_708]),
        ),
        max_size=8,
    )
)
def test_no_clock_makes_the_stage_raise(clocks: list[tuple[str, int, int, int, int]]) -> None:
    bridge = Bridge()
    stage = WordStage(TWO)
    for k, (adapter, device_ns, monotonic_ns, utc_ns, kind) in enumerate(clocks):
        data = bridge.packet(kind, 1, device_ns / SECOND_NS, b"\0" * 10) if device_ns < 2**63 else b"\0"
        for item in stage.feed(Raw(k, Stamp(monotonic_ns, utc_ns), adapter, data)):
            assert item.channel == 1


def shown(wanted: Wanted) -> list[str]:
    """The lines without time."""
    one, other = Bridge(), Bridge()
    latitude, longitude = position()[0], position()[2]
    records = [
        raw(0, 0, one.hello() + one.words(GNSS, 0, [latitude, longitude]) + one.radar(0, radial(0)), adapter="a"),
        raw(1, 1, other.hello() + other.words(GNSS, 1, [latitude]) + other.words(IRU, 1, [7]), adapter="b"),
    ]
    return [line.split(") ", 1)[1] for line in lines(records, TWO, wanted)]


def test_the_text_can_be_of_some_adapters_channels_and_labels_only() -> None:
    everything = shown(Wanted())
    assert len(everything) == 5
    assert shown(Wanted(adapters=frozenset(["b"]))) == [line for line in everything if line.startswith("b")]
    assert shown(Wanted(channels=frozenset([RADAR, IRU]))) == [everything[2], everything[4]]
    assert shown(Wanted(labels=frozenset([0o110]))) == [everything[0], everything[3]]
    both = Wanted(adapters=frozenset(["a"]), labels=frozenset([0o110, 0o111]))
    assert [line.split()[4] for line in shown(both)] == ["110", "111"]


def test_an_adapter_or_label_that_there_is_not_is_named_with_those_there_are() -> None:
    with pytest.raises(GatewayError, match="no adapter 'c' in the recording: name one of a, b"):
        Wanted.of(TWO, ["a", "c"], [], [])
    for label in ("389", "400", "", "0110"):
        with pytest.raises(GatewayError, match=f"label '{label}' is not octal: write 000 to 377"):
            Wanted.of(TWO, [], [], [label])
    assert Wanted.of(TWO, ["b"], [3], ["076", "1"]) == Wanted(frozenset("b"), frozenset([3]), frozenset([0o76, 0o1]))
