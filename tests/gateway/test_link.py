"""What a bridge says of itself, and what it lost."""

import pytest

from decoders import formats as f
from decoders.profiles import load_profile
from decoders.racklink import ChannelCount, Framer, Hello, HelloChannel, Packet
from gateway.config import AdapterConfig
from gateway.link import Channel429, Channel708, Link


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
        ((5, 5), 0, 1),
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


def test_losses_are_told_once() -> None:
    link = count(make(), 0, 4)
    link.dropped(12)
    assert link.take_losses() == ["degraded: bridge: 3 packets lost", "degraded: bridge: 12 bytes dropped"]
    assert link.take_losses() == []


def test_words_lost_in_the_bridge_are_the_growth_of_what_its_heartbeats_say() -> None:
    link = make()
    for lost in (5, 5, 9, 2**32 - 1, 0):
        link.heartbeat((ChannelCount(1, 0, lost), ChannelCount(2, 0, 3)))
    assert link.counters["words_lost_in_bridge"] == (2**32 - 1 - 5) + 1


@pytest.mark.parametrize("kind", [f.KIND_429_LOW, f.KIND_429_HIGH])
@pytest.mark.parametrize(("orientation", "name"), list(enumerate(f.ORIENTATIONS)))
def test_a_hello_tells_equipment_and_orientation(kind: int, orientation: int, name: str) -> None:
    link = make()
    link.hello(said(3, kind, orientation, 0x04))
    channel = link.channels[3]
    assert isinstance(channel, Channel429)
    assert (channel.equipment, channel.definitions.name, channel.orientation) == (4, "iru_704", name)


def test_a_hello_names_a_radar_channel() -> None:
    link = make()
    link.hello(said(0, f.KIND_708))
    assert link.channels == {0: Channel708(load_profile("arinc708"))}


def test_unknown_kinds_equipment_and_orientations_are_counted() -> None:
    link = make()
    for hello in (said(1, 0x55), said(2, f.KIND_429_LOW, 2, 4), said(3, f.KIND_429_LOW, 0, 0xEE)):
        link.hello(hello)
    assert link.channels == {}
    assert link.counters["channels_of_unknown_kind"] == 2
    assert link.counters["channels_of_unknown_equipment"] == 1


def test_configured_channels_win_over_the_hello() -> None:
    link = make(
        n1={"kind": "arinc429", "definitions": "adc_706", "orientation": "label_swapped"},
        n2={"kind": "arinc708", "profile": "wxr2100_6bit"},
    )
    configured = dict(link.channels)
    link.hello(said(1, f.KIND_429_LOW, 0, 0x04))
    link.hello(said(2, f.KIND_429_LOW, 0, 0x04))
    assert link.channels == configured
    channel = configured[1]
    assert isinstance(channel, Channel429)
    assert (channel.definitions.name, channel.orientation, channel.equipment) == ("adc_706", "label_swapped", 6)
    assert configured[2] == Channel708(load_profile("wxr2100_6bit"))


def test_a_channel_configured_without_definitions_takes_them_from_the_hello() -> None:
    link = make(n1={"kind": "arinc429", "orientation": "label_swapped"})
    link.hello(said(1, f.KIND_429_LOW, 0, 0x04))
    channel = link.channels[1]
    assert isinstance(channel, Channel429)
    assert (channel.definitions.name, channel.orientation) == ("iru_704", "label_swapped")


def test_all_counters_hold_the_framers_too() -> None:
    counters = count(make(), 0).all_counters()
    assert set(Framer().counters()) <= set(counters)
    assert counters["packets"] == 1
