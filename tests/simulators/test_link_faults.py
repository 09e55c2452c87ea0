"""What goes wrong on the line, for every kind of line."""

from functools import cache
from typing import Any

import pytest

from simulators import carriers, scenario
from simulators.carriers import Carrier, Frame, Name
from simulators.faults.link import FAULTS
from simulators.ledger import Ledger
from simulators.link import units
from simulators.scenario import LinkFault
from tests.simulators.small_bridge import CARRIERS, SECOND_NS, heard, sent

KINDS_OF_LINE: list[Name] = ["stream", "datagram", "can", "slcan"]
IMPOSSIBLE: list[tuple[Name, str]] = [
    ("can", "wrong_crc"),
    ("can", "stuck"),
    ("slcan", "wrong_crc"),
    ("datagram", "stuck"),
]
POSSIBLE = [(line, name) for line in KINDS_OF_LINE for name in FAULTS[line]]


def fault(name: str, **settings: float) -> LinkFault:
    return LinkFault.model_validate({"name": name, "start_s": 1.0, "stop_s": 2.0, **settings})


@cache
def healthy(line: Name) -> list[tuple[int, Any]]:
    return through(line)


def through(line: Name, *faults: LinkFault, seed: int = 1, ledger: Ledger | None = None) -> list[tuple[int, Any]]:
    carrier: Carrier[Any] = CARRIERS[line]()
    return sent(carrier, faults, ledger, seed)


def inside(found: list[tuple[int, Any]]) -> list[Any]:
    return [unit for ready_ns, unit in found if SECOND_NS <= ready_ns < 2 * SECOND_NS]


def pairs_inside(line: Name, name: str, **settings: float) -> list[tuple[Any, Any]]:
    """Each unit of the window as it was and as it came."""
    return list(zip(inside(healthy(line)), inside(through(line, fault(name, **settings))), strict=True))


def data(unit: bytes | Frame) -> bytes:
    return unit.data if isinstance(unit, Frame) else unit


@pytest.mark.parametrize(("line", "name"), POSSIBLE)
def test_the_same_seed_gives_the_same_units_and_outside_the_window_nothing_changes(line: Name, name: str) -> None:
    found = through(line, fault(name))
    assert found == through(line, fault(name)) != healthy(line)
    for begin, end in ((0, SECOND_NS), (2 * SECOND_NS + 1, 4 * SECOND_NS)):
        before, after = ([pair for pair in pairs if begin <= pair[0] < end] for pairs in (healthy(line), found))
        assert before == after


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_another_seed_hits_other_units(line: Name) -> None:
    assert through(line, fault("lost", chance=0.5), seed=2) != through(line, fault("lost", chance=0.5), seed=3)


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_nothing_comes_over_a_line_that_is_cut(line: Name) -> None:
    assert inside(through(line, fault("cut"))) == []


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_a_stall_ends_in_one_burst_of_everything_in_order(line: Name) -> None:
    found = through(line, fault("stall"))
    assert inside(found) == []
    assert [unit for _, unit in found] == [unit for _, unit in healthy(line)]
    assert [ready for ready, _ in found] == sorted(ready for ready, _ in found)
    held = inside(healthy(line))
    assert [unit for ready, unit in found if ready == 2 * SECOND_NS][: len(held)] == held


def test_a_stall_without_an_end_ends_with_the_traffic() -> None:
    endless = LinkFault(name="stall", start_s=1.0)
    assert [unit for _, unit in through("stream", endless)] == [unit for _, unit in healthy("stream")]


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_garbage_comes_between_the_units_and_leaves_them_as_they_are(line: Name) -> None:
    found = inside(through(line, fault("garbage", rate_hz=200.0)))
    rest = iter(found)
    assert all(unit in rest for unit in inside(healthy(line)))
    assert len(found) == len(inside(healthy(line))) + 200


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_a_bit_flip_turns_one_bit_over(line: Name) -> None:
    for before, after in pairs_inside(line, "bit_flips"):
        turned = int.from_bytes(data(before)) ^ int.from_bytes(data(after))
        assert turned.bit_count() == 1
        assert type(before) is type(after)
        assert not isinstance(before, Frame) or before.id == after.id


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_a_truncated_unit_lacks_its_end(line: Name) -> None:
    for before, after in pairs_inside(line, "truncated"):
        assert len(data(after)) < len(data(before))
        assert data(before).startswith(data(after))


def test_a_truncated_fd_frame_has_a_length_that_exists() -> None:
    found = sent(carriers.can(fd=True), [fault("truncated")])
    assert {len(frame.data) for frame in inside(found)} <= {*range(9), 12, 16, 20, 24, 32, 48, 64}


@pytest.mark.parametrize("line", KINDS_OF_LINE)
def test_a_doubled_unit_comes_twice_in_a_row(line: Name) -> None:
    found = inside(through(line, fault("doubled")))
    assert found[::2] == found[1::2] == inside(healthy(line))


@pytest.mark.parametrize("line", ["stream", "datagram"])
def test_a_wrong_crc_is_wrong_in_an_intact_frame(line: Name) -> None:
    whole, spoilt = ((inside(through(line, *faults)), line) for faults in ((), (fault("wrong_crc"),)))
    assert heard(*whole).words
    assert not heard(*spoilt).words
    assert not heard(*spoilt).counts
    if line == "stream":
        assert all(frame.count(0) == 1 and frame.endswith(b"\0") for frame in spoilt[0])


@pytest.mark.parametrize("line", ["stream", "slcan"])
def test_a_stuck_line_gives_as_many_bytes_of_ones(line: Name) -> None:
    for before, after in pairs_inside(line, "stuck"):
        assert after == b"\xff" * len(before)


@pytest.mark.parametrize("name", ["lost", "cut", "truncated", "bit_flips", "wrong_crc", "stuck"])
def test_what_a_stream_loses_is_what_the_last_heartbeat_says_less_what_arrived(name: str) -> None:
    chance = {} if name == "cut" else {"chance": 0.2}
    overflow = LinkFault(name="fifo_overflow", start_s=0.5, stop_s=1.5, chance=0.1)
    ledger = Ledger()
    found = through("stream", overflow, fault(name, **chance), ledger=ledger)
    whole = through("stream", overflow)
    arrived, without_fault = heard((unit for _, unit in found), "stream"), heard((unit for _, unit in whole), "stream")
    for channel, (received, lost) in arrived.counts.items():
        carried = sum(words for (number, _), words in ledger.carried.items() if number == channel)
        assert received + lost == carried
        assert received == without_fault.words[channel]
        assert arrived.words[channel] < received
    assert arrived.counts.keys() == {0, 1, 2}


@pytest.mark.parametrize("name", ["lost", "cut"])
def test_what_a_can_bus_loses_is_what_the_last_heartbeat_says_less_what_arrived(name: str) -> None:
    ledger = Ledger()
    arrived = heard((unit for _, unit in through("can", fault(name), ledger=ledger)), "can")
    for channel, (received, lost) in arrived.counts.items():
        carried = sum(words for (number, _), words in ledger.carried.items() if number == channel)
        assert (received, lost) == (carried, 0)
        assert arrived.words[channel] == carried * 2 // 3  # a second of three


def test_faults_follow_one_another_as_they_are_listed() -> None:
    spoilt = fault("bit_flips", chance=0.5), fault("truncated", chance=0.5), fault("wrong_crc", chance=0.5)
    found = through("stream", *spoilt, fault("doubled"), fault("garbage"))
    assert found == through("stream", *spoilt, fault("doubled"), fault("garbage"))
    assert len(inside(found)) == 2 * len(inside(healthy("stream"))) + 100


def test_a_whole_scenario_goes_through_its_faults_and_is_the_same_again() -> None:
    flight = scenario.white_mountains(2.0)
    faults = LinkFault(name="lost", chance=0.1), LinkFault(name="fifo_overflow", chance=0.1, stop_s=1.0)
    plan = flight.model_copy(
        update={"link_faults": faults, "radar": flight.radar.model_copy(update={"step_deg": 3.0, "range_nm": 5.0})}
    )
    ledger, again = Ledger(), Ledger()
    found = list(units(plan, carriers.datagram(), ledger))
    assert found == list(units(plan, carriers.datagram(), again))
    assert ledger == again
    arrived = heard((unit for _, unit in found), "datagram")
    assert sum(arrived.words.values()) < sum(received for received, _ in arrived.counts.values())
    assert sum(sum(pair) for pair in arrived.counts.values()) == sum(ledger.carried.values())


@pytest.mark.parametrize(("line", "name"), IMPOSSIBLE)
def test_a_fault_that_a_line_cannot_have_is_refused(line: Name, name: str) -> None:
    plan = scenario.white_mountains(2.0).model_copy(update={"link_faults": (fault(name),)})
    carrier: Carrier[Any] = CARRIERS[line]()
    with pytest.raises(ValueError, match=f"{name} cannot be on {line}"):
        units(plan, carrier)
