"""Many records at once say what they say one by one, however they are cut and whatever goes wrong on the way."""

import json
import struct
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from itertools import cycle

import numpy as np
import pytest
from cobs import cobs
from numpy.typing import NDArray

from decoders import formats as f
from decoders.framing import Packets
from decoders.racklink import Framer, HelloChannel, Packet, hello
from gateway.chunks import Block
from gateway.config import check_config
from gateway.link import Link
from gateway.metadata import build_monitor
from gateway.pipeline import Pipeline
from gateway.records import Raw, Record, Status, Tick
from simulators import racklink
from simulators.link import whole_stream
from simulators.scenario import BUILT_IN_TERRAIN, Radar, white_mountains
from tests.decoders.bus import word429
from tests.gateway.made import SECOND_NS, stamp

SWEEP_S = 61 * 3 / 40
CHUNK_NS = 10_000_000
MID_SCAN_NS = 1_500_000_000  # of the first of two
RADAR, IRU, BEHIND, RELIEF = 0, 1, 8, 9  # channels
GNSS_ID = 0x00B
ADIRU = word429(0o377, {11: (0x038, 12)})
OTHER_DATA = 0b11 << 24  # two bits, so that the parity stays right
Change = Callable[[np.random.Generator, Packet], list[Packet]]


def announcing(packet: Packet, channels: Iterable[HelloChannel]) -> Packet:
    """A hello with other channels."""
    said = hello(packet)
    return packet._replace(body=racklink.hello(said.serial_number, said.firmware, [*channels]))


def own(packet: Packet, name: str) -> Packet:
    """A packet as a bridge sends it that has the radar, if it is the line's, or else all other channels."""
    if packet.type != f.HELLO:
        return packet
    return announcing(packet, [said for said in hello(packet).channels if (said.channel == RADAR) == (name == "line")])


def lost(random: np.random.Generator, packet: Packet) -> list[Packet]:
    return [packet] if random.random() > 0.02 else []


def doubled(random: np.random.Generator, packet: Packet) -> list[Packet]:
    return [packet] * (1 + (random.random() < 0.02))


def flagged(random: np.random.Generator, packet: Packet) -> list[Packet]:
    flags = (f.FLAG_FIFO_OVERFLOW, f.FLAG_WORD_LENGTH, f.FLAG_PARITY)
    return [packet._replace(flags=int(random.choice(flags)) if random.random() < 0.02 else 0)]


def clock_jumps(_: np.random.Generator, packet: Packet) -> list[Packet]:
    return [packet._replace(time_ns=packet.time_ns + (100 * SECOND_NS if packet.time_ns > 6 * SECOND_NS else 0))]


def cut_body(random: np.random.Generator, packet: Packet) -> list[Packet]:
    return [
        packet._replace(body=packet.body[: random.integers(len(packet.body))]) if random.random() < 0.02 else packet
    ]


def falls_silent(_: np.random.Generator, packet: Packet) -> list[Packet]:
    silent = packet.channel != RADAR and SECOND_NS < packet.time_ns < 7.5 * SECOND_NS
    return [] if silent else [packet]


def radar_pauses(_: np.random.Generator, packet: Packet) -> list[Packet]:
    return [] if packet.channel == RADAR and SECOND_NS < packet.time_ns < 7.5 * SECOND_NS else [packet]


def says_what_it_is(_: np.random.Generator, packet: Packet) -> list[Packet]:
    """The radar alone is announced; the other buses begin in mid-scan, and label 377 says what they are."""
    if packet.type == f.HELLO:
        return [announcing(packet, [said for said in hello(packet).channels if said.channel == RADAR])]
    return [packet] if packet.type != f.WORDS_429 or packet.time_ns > MID_SCAN_NS else []


def is_relieved(_: np.random.Generator, packet: Packet) -> list[Packet]:
    """A second IRU that nobody announced begins in mid-scan; the first falls silent, and in a later scan it is used."""
    if packet.type != f.WORDS_429 or packet.channel != IRU:
        return [packet]
    first = [packet] if packet.time_ns < 3 * SECOND_NS else []
    return first + ([packet._replace(channel=RELIEF)] if packet.time_ns > MID_SCAN_NS else [])


def has_a_twin(_: np.random.Generator, packet: Packet) -> list[Packet]:
    """Beside the IRU an ADIRU, on a channel with a lower number, that gives the same quantities other values.

    Both begin in mid-scan. The IRU is announced, and is heard before the other one is known: so its words are used.
    """
    if packet.type == f.HELLO and packet.time_ns > SECOND_NS:
        return []  # each has what waits be read
    if packet.type == f.HELLO:
        channels = hello(packet).channels
        return [announcing(packet, [s._replace(channel=BEHIND) if s.channel == IRU else s for s in channels])]
    if packet.type != f.WORDS_429 or packet.channel != IRU:
        return [packet]
    entries = np.frombuffer(packet.body, "<u4").reshape(-1, 2).copy()
    words = entries[:, 1]
    words[:] = np.where(words & 0xFF == 0o377, ADIRU, words ^ OTHER_DATA)
    twin = packet._replace(body=entries.tobytes(), time_ns=packet.time_ns + 3_000_000)
    iru = [packet._replace(channel=BEHIND)] if packet.time_ns > MID_SCAN_NS + SECOND_NS else []
    return iru + ([twin] if packet.time_ns > MID_SCAN_NS else [])


def has_an_announced_twin(_: np.random.Generator, packet: Packet) -> list[Packet]:
    """The same two, both announced; the IRU begins in mid-scan, is asked for, and the other begins behind it.

    So the IRU's words are used, though the other's channel has the lower number.
    """
    if packet.type == f.HELLO:
        channels = hello(packet).channels
        behind = [said._replace(channel=BEHIND) for said in channels if said.channel == IRU]
        twins = [said._replace(equipment_id=0x038) if said.channel == IRU else said for said in channels]
        return [announcing(packet, [*twins, *behind])]
    if packet.type != f.WORDS_429 or packet.channel != IRU:
        return [packet]
    entries = np.frombuffer(packet.body, "<u4").reshape(-1, 2).copy()
    entries[:, 1] ^= OTHER_DATA
    iru = [packet._replace(channel=BEHIND)] if packet.time_ns > MID_SCAN_NS else []
    return iru + ([packet._replace(body=entries.tobytes())] if packet.time_ns > 2 * MID_SCAN_NS else [])


def becomes_another(_: np.random.Generator, packet: Packet) -> list[Packet]:
    """In the second scan the bridge says that the IRU's channel is a GNSS receiver's; there is one already."""
    if packet.type != f.HEARTBEAT or packet.time_ns < 2 * SWEEP_S * SECOND_NS - 2 * SECOND_NS:
        return [packet]
    said = hello(flight()[0]).channels
    channels = [other._replace(equipment_id=GNSS_ID) if other.channel == IRU else other for other in said]
    again = packet._replace(type=f.HELLO, channel=0, body=racklink.hello(1, 1, [*channels]))
    return [again, packet]


def as_it_is(_: np.random.Generator, packet: Packet) -> list[Packet]:
    return [packet]


CHANGES: list[Change] = [
    as_it_is,
    lost,
    doubled,
    flagged,
    clock_jumps,
    cut_body,
    falls_silent,
    radar_pauses,
    says_what_it_is,
    is_relieved,
    has_a_twin,
    has_an_announced_twin,
    becomes_another,
]


@cache
def flight() -> list[Packet]:
    scenario = white_mountains(2 * SWEEP_S, seed=3).model_copy(
        update={"radar": Radar(step_deg=3.0), "gnss_interval_s": 0.2}
    )
    return Framer().feed(whole_stream(scenario))


def flown(change: Change, noise: float = 0.0) -> list[Record]:
    """Two bridges over two sweeps, one with the radar on a serial line and one with the other buses on UDP."""
    random, sequences = np.random.default_rng(5), {"line": 0, "net": 7}
    read: dict[tuple[int, str], bytes] = {}
    for packet in flight():
        for name in ("line", "net"):
            if packet.type in (f.WORDS_429, f.WORD_708) and (packet.channel == RADAR) != (name == "line"):
                continue
            sequences[name] += 1
            before = None
            for p in change(random, own(packet, name)):
                sequences[name] += before not in (None, p)
                before = p
                sent = (p.type, p.channel, sequences[name], p.time_ns + (name == "net") * SECOND_NS, p.body, p.flags)
                garbage = random.integers(0, 256, 9, np.uint8).tobytes() if random.random() < noise else b""
                data = racklink.encode(*sent)
                if name == "net":
                    data = in_datagrams(packet.time_ns, [garbage, cobs.decode(data[:-1])])
                else:
                    data = garbage + data
                at = packet.time_ns // CHUNK_NS + (name == "net"), name
                read[at] = read.get(at, b"") + data
    read |= {(100 * k, "tick"): b"" for k in range(1, 10)}
    records: list[Record] = [Status(0, stamp(0), "line", "UP"), Status(1, stamp(0), "net", "UP")]
    for (chunk, name), data in sorted(read.items()):
        when, sequence = stamp(chunk * CHUNK_NS / SECOND_NS), len(records)
        dropped = 7 if sequence % 301 == 300 else 0
        records.append(Tick(sequence, when) if name == "tick" else Raw(sequence, when, name, data, dropped))
    return records


def in_datagrams(arrival_ns: int, datagrams: list[bytes]) -> bytes:
    return b"".join(struct.pack(f.DATAGRAM_RECORD, arrival_ns, len(data)) + data for data in datagrams if data)


def pipeline(tells_state: bool) -> Pipeline:
    adapters = [{"name": "line", "source": "serial:x"}, {"name": "net", "source": "udp:127.0.0.1:1"}]
    config = check_config({"adapters": adapters, "terrain": [BUILT_IN_TERRAIN["white_mountains"]]}, "test")
    return Pipeline(config, build_monitor(config), tells_state=tells_state)


def given(records: list[Record], sizes: list[int], tells_state: bool = True) -> list[str]:
    """The events of records that are fed so many at a time, in turn; 1 is one by one."""
    made, lines, at = pipeline(tells_state), list[str](), 0
    for size in cycle(sizes):
        if at >= len(records):
            break
        events = made.feed(records[at]) if size == 1 else made.feed_all(Block.of([records[at : at + size]]))
        lines += [event.to_json() for event in events]
        at += size
    return lines + [event.to_json() for event in made.finish()]


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("change", CHANGES)
def test_many_records_at_once_say_what_they_say_one_by_one(change: Change, noise: float) -> None:
    records = flown(change, noise)
    expected = given(records, [1])
    assert sum('"type":"integrity"' in line for line in expected) >= 2
    for sizes in ([len(records)], [100], [3, 50, 1, 400]):
        assert given(records, sizes) == expected


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("begin", [0, 2, 60], ids=["whole", "without states", "cut"])
def test_where_nobody_asks_for_the_state_the_verdicts_and_counters_are_the_same(
    change: Change, noise: float, begin: int
) -> None:
    records = flown(change, noise)[begin:]
    judged = '"type":"scan"', '"type":"integrity"', '"type":"summary"'
    expected = [line for line in given(records, [1]) if any(kind in line for kind in judged)]
    for sizes in ([1], [len(records)], [100]):
        lines = given(records, sizes, tells_state=False)
        assert [line for line in lines if any(kind in line for kind in judged)] == expected


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (says_what_it_is, {1: "iru_704", 2: "gnss_743a", 3: "ra_707"}),
        (is_relieved, {RELIEF: "iru_704"}),
        (has_a_twin, {IRU: "adiru_738"}),
    ],
)
def test_a_channel_that_says_in_mid_scan_what_it_is_serves_the_scans_that_need_it(
    change: Change, said: dict[int, str]
) -> None:
    """The first scan lacks the state on some radials; without the channel the second would on all of them."""
    events = [json.loads(line) for line in given(flown(change), [1])]
    told = {event["reason"]: at for at, event in enumerate(events) if event.get("state") == "IDENTIFIED"}
    assert set(told) == {
        f"label 377 says what channel {channel} is: read as {name} from now on" for channel, name in said.items()
    }
    assert max(told.values()) < next(at for at, event in enumerate(events) if event["type"] == "scan")
    first, second = (event for event in events if event["type"] == "integrity")
    assert any("of 61 radials" in reason for reason in first["reasons"])
    assert min(first["n_pairs"], second["n_pairs"]) > 0


def test_most_packets_of_a_flight_are_taken_many_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    packets = Counter[str]()
    count_plain, count = Link.count_plain, Link.count

    def many(link: Link, batch: Packets, own: NDArray[np.intp], latest_ns: int) -> None:
        packets["many"] += len(own)
        count_plain(link, batch, own, latest_ns)

    def one(link: Link, packet: Packet) -> bool:
        packets["one"] += 1
        return count(link, packet)

    monkeypatch.setattr(Link, "count_plain", many)
    monkeypatch.setattr(Link, "count", one)
    records = flown(as_it_is)
    given(records, [len(records)])
    assert packets["many"] > 5 * packets["one"]
