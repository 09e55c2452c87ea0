"""A scenario as the byte stream of one bridge: hello, heartbeats, ARINC 429 and 708 words in the order they end."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from decoders.formats import HEARTBEAT, HELLO, KIND_708
from simulators import racklink
from simulators.flight import Trajectory, Truth
from simulators.instruments import channels
from simulators.radar import METRES_PER_NM, Radar
from simulators.scenario import Scenario
from simulators.schedule import Line429, Line708, Packet
from simulators.terrain import Ground, build

RADAR_CHANNEL = 0
SERIAL_NUMBER, FIRMWARE = 1, 0x0100
BLOCK_NS = 100_000_000  # a multiple of the bridge's batch; a live reader waits for one to be made
HEARTBEAT_NS = 1_000_000_000
HELLO_NS = 10_000_000_000
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


def traffic(scenario: Scenario) -> Iterator[tuple[int, bytes]]:
    """Encoded packets, each with the device time in ns at which it is complete, in that order, made on demand.

    The same scenario gives the same bytes. Raises as `prepare` does, when the first packet is asked for.
    """
    simulation = prepare(scenario)
    buses = channels(scenario, simulation.trajectory, simulation.ground)
    lines, radar_line = [Line429(channel) for channel in buses], Line708(RADAR_CHANNEL)
    kinds = {RADAR_CHANNEL: (KIND_708, 0)} | {bus.number: (bus.kind, bus.equipment) for bus in buses}
    bridge = Bridge(kinds)
    total_ns = round(scenario.flight.total_s * 1e9)
    waiting: list[Packet] = []
    for start in range(0, total_ns, BLOCK_NS):
        end = start + BLOCK_NS
        waiting += bridge.routine(start, end)
        for line in lines:
            waiting += line.until(end)
        radials = simulation.radar.between(start / 1e9, end / 1e9)
        due = np.rint(radials.time_s * 1e9).astype(np.int64)
        waiting += radar_line.packets(due, simulation.radar.words(radials))
        limit = min(end, total_ns)
        for packet in sorted(packet for packet in waiting if packet.ready_ns < limit):
            yield packet.ready_ns, bridge.encode(packet)
        waiting = [packet for packet in waiting if packet.ready_ns >= limit]


class Bridge:
    """The device between buses and host: it numbers packets and counts the words that it passes on."""

    def __init__(self, kinds: dict[int, tuple[int, int]]) -> None:
        """`kinds` gives each channel's kind and equipment identity."""
        self._kinds = kinds
        self._received = dict.fromkeys(kinds, 0)
        self._sequence = 0

    def routine(self, start_ns: int, end_ns: int) -> Iterator[Packet]:
        """The hellos and heartbeats of [start, end); a heartbeat's counts are filled in when it is sent."""
        for interval, kind in ((HELLO_NS, HELLO), (HEARTBEAT_NS, HEARTBEAT)):
            for time in range(-(-start_ns // interval) * interval, end_ns, interval):
                yield Packet(time, RADAR_CHANNEL, kind, time, b"")

    def encode(self, packet: Packet) -> bytes:
        """The packet's bytes, with the next number of the sequence."""
        body = self._body(packet)
        self._received[packet.channel] += packet.words
        encoded = racklink.encode(packet.type, packet.channel, self._sequence, packet.time_ns, body)
        self._sequence += 1
        return encoded

    def _body(self, packet: Packet) -> bytes:
        if packet.type == HELLO:
            listed = ((number, kind, 0, equipment) for number, (kind, equipment) in self._kinds.items())
            return racklink.hello(SERIAL_NUMBER, FIRMWARE, listed)
        if packet.type == HEARTBEAT:
            return racklink.heartbeat((number, count, 0) for number, count in self._received.items())
        return packet.body
