"""What a bridge says of itself, and what it lost."""

import pytest
from pydantic import ValidationError

from decoders import formats as f
from decoders.profiles import load_profile
from decoders.racklink import ChannelCount, Framer, Hello, HelloChannel, Packet
from gateway.channels import Channel429, Channel708
from gateway.config import AdapterConfig
from gateway.link import Link
from simulators import racklink
from tests.decoders.bus import word429


def make(**channels: object) -> Link:
    table = {"name": "bridge", "source": "serial:x", "channels": {k.removeprefix("n"): v for k, v in channels.items()}}
    return Link(AdapterConfig.model_validate(table), load_profile("arinc708"))


def said(channel: int, kind: int, orientation: int = 0, equipment: int = 0) -> Hello:
    return Hello(1, 1, (HelloChannel(channel, kind, orientation, equipment),))


def count(link: Link, *sequences: int, flags: int = 0) -> Link:
    for sequence in sequences:
        link.count(Packet(f.HEARTBEAT, 0, flags, sequence, 0, b""))
    return link


@pytest.mark.parametrize(
    ("sequences", "lost", "restarts"),
    [
        ((0, 1, 2, 3), 0, 0),
        ((7, 8, 9), 0, 0),
        ((0, 1, 5, 6), 3, 0),
        ((2**32 - 2, 2**32 - 1, 0, 1), 0, 0),
        ((2**32 - 2, 3), 4, 0),
        ((1000, 1001, 0, 1), 0, 1),
    ],
)
def test_gaps_wraps_and_restarts_of_the_sequence(sequences: tuple[int, ...], lost: int, restarts: int) -> None:
    link = count(make(), *sequences)
    assert link.counters["packets"] == len(sequences)
    assert link.counters["packets_lost"] == lost
    assert link.counters["sequence_restarts"] == restarts


def test_each_flag_is_counted_by_its_name() -> None:
    link = count(make(), 0, flags=0x1F)
    names = ("fifo_overflow", "parity_error", "coding_error", "word_length_error", "sync_error")
    assert [link.counters[name] for name in names] == [1] * 5


def test_the_same_packet_once_more_is_counted_apart_and_not_used_again() -> None:
    link, packet = make(), Packet(f.HEARTBEAT, 0, 0, 7, 1000, b"body")
    assert [link.count(packet), link.count(packet), link.count(packet._replace(body=b"other"))] == [True, False, True]
    assert (link.counters["packets"], link.counters["packets_repeated"], link.counters["packets_lost"]) == (2, 1, 0)


def test_losses_are_told_once() -> None:
    link = count(make(), 0, 4)
    link.dropped(12)
    assert link.take_losses() == ["degraded: bridge: 3 packets lost", "degraded: bridge: 12 bytes dropped"]
    assert link.take_losses() == []


def test_words_lost_in_the_bridge_are_the_growth_of_what_its_heartbeats_say() -> None:
    link = make()
    for lost in (2**32 - 5, 2**32 - 5, 2**32 - 1, 0, 7):
        link.heartbeat((ChannelCount(1, 0, lost), ChannelCount(2, 0, 3)))
    assert link.all_counters()["words_lost_in_bridge"] == 12
    assert link.take_losses() == ["degraded: bridge: 12 words lost in the bridge"]


def test_a_bridge_that_begins_anew_has_lost_what_it_said_before() -> None:
    link = make()
    for lost in (5, 9, 0, 2):
        link.heartbeat((ChannelCount(1, 0, lost),))
    assert link.all_counters()["channel_1.words_lost_in_bridge"] == 6


@pytest.mark.parametrize(
    ("said", "arrived", "lost"),
    [
        ((0, 10, 20), (0, 10, 20), (0, 0, 0)),
        ((0, 10, 20), (0, 7, 17), (0, 3, 3)),
        ((500, 510, 530), (20, 30, 45), (0, 0, 5)),  # listening began in the middle
        ((2**32 - 5, 5, 15), (0, 10, 19), (0, 0, 1)),  # the count wraps
        ((100, 0, 10), (100, 103, 113), (0, 0, 0)),  # the bridge began anew
        ((0, 10, 20), (0, 12, 20), (0, 0, 0)),  # a heartbeat that came a little late
        ((0, 10, 74, 30), (0, 10, 20, 30), (0, 0, 54, 0)),  # one altered on its way
        ((40, 50, 12, 70), (0, 10, 20, 28), (0, 0, 0, 2)),  # and one that looks like a new beginning
    ],
)
def test_what_a_bridge_says_that_it_sent_and_did_not_arrive_is_lost_on_the_link(
    said: tuple[int, ...], arrived: tuple[int, ...], lost: tuple[int, ...]
) -> None:
    link = make()
    for received, words, missing in zip(said, arrived, lost, strict=True):
        link.books[1].arrived = words
        link.heartbeat((ChannelCount(1, received, 0),))
        assert (
            link.all_counters()["words_lost_on_link"] == link.all_counters()["channel_1.words_lost_on_link"] == missing
        )
    told = [f"degraded: bridge: {max(lost)} words lost on the link"] if max(lost) else []
    assert link.take_losses() == told


@pytest.mark.parametrize(
    ("before", "after", "lost"),
    [
        ((100, 0), (20, 0), 0),
        ((100, 0), (105, 0), 60),
        ((0, 100), (45, 3), 0),
    ],
    ids=["clean", "lost on the link", "lost in the bridge"],
)
def test_the_counts_of_a_bridge_that_begins_anew_go_on_from_zero(
    before: tuple[int, int], after: tuple[int, int], lost: int
) -> None:
    link = count(make(), 0, 1000, 1001)
    link.heartbeat((ChannelCount(1, 0, 0),))
    link.books[1].arrived = before[0]
    link.heartbeat((ChannelCount(1, *before),))
    count(link, 0, flags=f.FLAG_PARITY)
    link.books[1].arrived += after[0] - lost
    link.heartbeat((ChannelCount(1, *after),))
    counters = link.all_counters()
    assert counters["channel_1.words_lost_on_link"] == lost
    assert counters["channel_1.words_lost_in_bridge"] == before[1] + after[1]


def test_a_bridge_on_can_that_begins_anew_shows_by_its_clock_and_its_counts() -> None:
    link = Link(AdapterConfig(name="bridge", source="can:virtual:a"), load_profile("arinc708"))

    def say(sequence: int, time_s: int, arrived: int, received: int) -> None:
        link.count(Packet(f.WORDS_429, 1, 0, sequence, time_s * 10**9, b""))
        link.books[1].arrived += arrived
        link.heartbeat((ChannelCount(1, received, 0),))

    say(0, 100, 0, 500)
    say(1, 110, 400, 900)
    say(2, 1, 20, 70)
    assert link.all_counters()["channel_1.words_lost_on_link"] == 50
    say(3, 2, 30, 100)
    assert link.all_counters()["channel_1.words_lost_on_link"] == 50


def test_several_packets_may_be_overtaken_by_one() -> None:
    link = make()
    packets = [Packet(f.HEARTBEAT, 0, 0, k, 1000 * k, b"") for k in (0, 4, 1, 2, 3, 5)]
    assert all(link.count(packet) for packet in packets)
    assert (link.counters["packets_late"], link.counters["packets_lost"]) == (3, 0)


def test_a_packet_that_others_have_overtaken_is_not_lost() -> None:
    link = make()
    packets = [Packet(f.HEARTBEAT, 0, 0, k, 1000 * k, b"") for k in (0, 1, 3, 4, 2, 5)]
    assert all(link.count(packet) for packet in packets)
    assert (link.counters["packets_late"], link.counters["packets_lost"], link.counters["sequence_restarts"]) == (
        1,
        0,
        0,
    )


def test_a_network_may_repeat_a_packet_after_others() -> None:
    link = make()
    packets = [Packet(f.HEARTBEAT, 0, 0, k, 1000 * k, b"") for k in (0, 1, 2, 1, 0, 3)]
    assert [link.count(packet) for packet in packets] == [True, True, True, False, False, True]
    assert (link.counters["packets_repeated"], link.counters["packets_lost"]) == (2, 0)


@pytest.mark.parametrize(
    ("source", "unit"),
    [("serial:x", "bytes"), ("usb:1:2", "bytes"), ("udp:1", "datagrams"), ("can:socketcan:can0", "frames")],
)
def test_what_is_dropped_is_counted_in_the_units_of_its_line(source: str, unit: str) -> None:
    link = Link(AdapterConfig(name="bridge", source=source), load_profile("arinc708"))
    link.dropped(7)
    assert link.take_losses() == [f"degraded: bridge: 7 {unit} dropped"]
    assert link.all_counters()[f"{unit}_dropped"] == 7


@pytest.mark.parametrize(("source", "named"), [("can:slcan:x", True), ("udp:127.0.0.1:1", False)])
def test_a_radar_word_names_its_channel_where_no_bridge_can_say_hello(source: str, named: bool) -> None:
    link = Link(AdapterConfig(name="bridge", source=source), load_profile("arinc708"))
    assert link.radar(4) == (Channel708(load_profile("arinc708")) if named else None)


@pytest.mark.parametrize("kind", [f.KIND_429_LOW, f.KIND_429_HIGH])
@pytest.mark.parametrize(("orientation", "name"), list(enumerate(f.ORIENTATIONS)))
def test_a_hello_tells_equipment_and_orientation(kind: int, orientation: int, name: str) -> None:
    link = make()
    link.channels |= link.announced(said(3, kind, orientation, 0x04))
    channel = link.channels[3]
    assert isinstance(channel, Channel429)
    assert (channel.definitions.name, channel.orientation) == ("iru_704", name)


def test_a_hello_names_a_radar_channel() -> None:
    link = make()
    link.channels |= link.announced(said(0, f.KIND_708))
    assert link.channels == {0: Channel708(load_profile("arinc708"))}


def test_what_a_hello_says_again_is_no_news() -> None:
    link = make()
    for _ in range(2):
        link.channels |= link.announced(said(0, f.KIND_708)) | link.announced(said(3, f.KIND_429_HIGH, 0, 0x04))
    assert link.announced(said(0, f.KIND_708)) == link.announced(said(3, f.KIND_429_HIGH, 0, 0x04)) == {}
    assert [*link.announced(said(3, f.KIND_429_LOW, 0, 0x04))] == [3]


def test_unknown_kinds_equipment_and_orientations_are_counted() -> None:
    link = make()
    for hello in (said(1, 0x55), said(2, f.KIND_429_LOW, 2, 4), said(3, f.KIND_429_LOW, 0, 0xEE)):
        link.channels |= link.announced(hello)
    assert link.channels == {}
    assert link.counters["channels_of_unknown_kind"] == 2
    assert link.counters["channels_of_unknown_equipment"] == 1


def test_configured_channels_win_over_the_hello() -> None:
    link = make(
        n1={"kind": "arinc429", "definitions": "adc_706", "orientation": "label_swapped"},
        n2={"kind": "arinc708", "profile": "wxr2100_6bit"},
    )
    configured = dict(link.channels)
    link.channels |= link.announced(said(1, f.KIND_429_LOW, 0, 0x04))
    link.channels |= link.announced(said(2, f.KIND_429_LOW, 0, 0x04))
    assert link.channels == configured
    channel = configured[1]
    assert isinstance(channel, Channel429)
    assert (channel.definitions.name, channel.orientation) == ("adc_706", "label_swapped")
    assert configured[2] == Channel708(load_profile("wxr2100_6bit"))


def test_a_channel_configured_without_definitions_takes_them_from_the_hello() -> None:
    link = make(n1={"kind": "arinc429", "orientation": "label_swapped"})
    link.channels |= link.announced(said(1, f.KIND_429_LOW, 0, 0x04))
    channel = link.channels[1]
    assert isinstance(channel, Channel429)
    assert (channel.definitions.name, channel.orientation) == ("iru_704", "label_swapped")


def test_all_counters_hold_the_framers_too() -> None:
    counters = count(make(), 0).all_counters()
    assert set(Framer().counters()) <= set(counters)
    assert counters["packets"] == 1


def equipment_words(*equipment: int, odd: bool = True, ssm: int = 0, flags: int = 0) -> Packet:
    words = [word429(0o377, {11: (number, 12)}, ssm, odd) for number in equipment]
    return Packet(f.WORDS_429, 3, flags, 0, 0, racklink.words_429([0] * len(words), words))


def test_a_channel_that_nobody_announced_is_taken_by_its_own_equipment_label_said_twice() -> None:
    link = make()
    assert link.identify(equipment_words(0x00B)) is None
    assert link.identify(equipment_words(0x004, 0x00B)) is None
    assert link.identify(equipment_words(0x00B)) == "gnss_743a"
    channel = link.channels[3]
    assert isinstance(channel, Channel429)
    assert channel.definitions.name == "gnss_743a"


def test_neither_damaged_nor_unknown_equipment_labels_take_a_channel() -> None:
    link = make()
    assert link.identify(equipment_words(0x00B, 0x00B, odd=False)) is None
    assert link.identify(equipment_words(0x0FE, 0x0FE)) is None
    assert link.identify(equipment_words(0x00B, 0x00B, ssm=1)) is None
    assert link.identify(equipment_words(0x00B, 0x00B, flags=f.FLAG_WORD_LENGTH)) is None
    assert link.channels == {}


def test_the_configuration_gives_a_channel_its_delays_and_its_rule_of_joining() -> None:
    table = {
        "kind": "arinc429",
        "definitions": "iru_704",
        "delays_ms": {"324": 20, "325": 7.5},
        "join_rule": "toward_zero",
    }
    channel = make(n2=table).channels[2]
    assert isinstance(channel, Channel429)
    assert channel.join_rule == "toward_zero"
    assert {label: delay for label, delay in enumerate(channel.delays_ns.tolist()) if delay} == {
        0o324: 20_000_000,
        0o325: 7_500_000,
    }


@pytest.mark.parametrize(
    ("delays", "why"), [({"8": 1}, "three octal digits"), ({"324": -1}, "greater than or equal to 0")]
)
def test_a_delay_of_no_label_or_of_the_past_is_refused(delays: dict[str, float], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        make(n2={"kind": "arinc429", "delays_ms": delays})
