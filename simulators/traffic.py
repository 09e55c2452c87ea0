"""A scenario as the packets of one bridge: hello, heartbeats, ARINC 429 and 708 words in the order they end."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from decoders.formats import KIND_708
from simulators import bridge
from simulators.bridge import Bridge
from simulators.faults import device, through
from simulators.flight import Trajectory, Truth
from simulators.instruments import Channel, channels
from simulators.ledger import Ledger
from simulators.racklink import Packet
from simulators.radar import METRES_PER_NM, Radar
from simulators.scenario import Scenario
from simulators.schedule import Due, Line429, Line708
from simulators.terrain import Ground, build

RADAR_CHANNEL = 0
BLOCK_NS = 100_000_000  # a multiple of the bridge's batch; a live reader waits for one to be made
TRACK_STEP_S = 2.0
REACH_MARGIN_M = 250.0


@dataclass(frozen=True)
class Simulation:
    """A scenario brought to life: where the aircraft is, the ground, and the radar that looks at it."""

    scenario: Scenario
    trajectory: Trajectory
    ground: Ground
    radar: Radar


def prepare(scenario: Scenario) -> Simulation:
    """Fly the trajectory and cut out the ground that its radar can reach;

    raises as `terrain.build` does, and ValueError when the flight meets the ground.
    """
    trajectory = Trajectory(scenario.flight, scenario.seed)
    track = trajectory.at(np.append(np.arange(0.0, scenario.flight.total_s, TRACK_STEP_S), scenario.flight.total_s))
    reach = scenario.radar.range_nm * METRES_PER_NM + REACH_MARGIN_M
    ground = build(scenario.world, track.latitude_deg, track.longitude_deg, reach, scenario.seed)
    _refuse_crash(track, ground)
    return Simulation(scenario, trajectory, ground, Radar(scenario, ground, trajectory))


def _refuse_crash(track: Truth, ground: Ground) -> None:
    clearance = track.height_m - ground.elevation(*ground.locate(track.latitude_deg, track.longitude_deg))
    low = np.flatnonzero(clearance < 0)
    if len(low):
        raise ValueError(
            f"the flight meets the ground after {track.time_s[low[0]]:.0f} s, "
            f"{-clearance[low[0]]:.0f} m below its surface: raise flight.height_m or turn away"
        )


def traffic(scenario: Scenario, ledger: Ledger | None = None) -> Iterator[tuple[int, Packet]]:
    """Packets, each with the ns at which it is ready, in that order, made on demand; the last is a heartbeat.

    The same scenario gives the same packets. The books are kept in `ledger`. Raises as `prepare` does, when the first
    packet is asked for.
    """
    simulation = prepare(scenario)
    buses = channels(scenario, simulation.trajectory, simulation.ground)
    kinds = {RADAR_CHANNEL: (KIND_708, 0)} | {bus.number: (bus.kind, bus.equipment) for bus in buses}
    dues = through(_dues(simulation, buses), scenario.link_faults, device.FAULTS, scenario.seed)
    yield from Bridge(kinds, Ledger() if ledger is None else ledger).packets(dues)


def _dues(simulation: Simulation, buses: Sequence[Channel]) -> Iterator[Due]:
    """All that the bridge has to send, in order."""
    lines, radar_line = [Line429(channel) for channel in buses], Line708(RADAR_CHANNEL)
    total_ns = round(simulation.scenario.flight.total_s * 1e9)
    waiting: list[Due] = []
    for start in range(0, total_ns, BLOCK_NS):
        end = start + BLOCK_NS
        waiting += bridge.routine(start, end)
        for line in lines:
            waiting += line.until(end)
        radials = simulation.radar.between(start / 1e9, end / 1e9)
        begins = np.rint(radials.time_s * 1e9).astype(np.int64)
        waiting += radar_line.words(begins, simulation.radar.words(radials))
        limit = min(end, total_ns)
        yield from sorted(due for due in waiting if due.ready_ns < limit)
        waiting = [due for due in waiting if due.ready_ns >= limit]
    yield bridge.heartbeat(total_ns)  # tells of losses since the one before
