"""Makes one golden recording with the writer as it is now: `python -m tests.golden.make NAME`; never one over another.

Ten seconds over the mountains on two bridges, with stamps that do not come from a clock: the same code gives the same
bytes. A recording that is there stays for ever, so that what its format's version wrote stays readable.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from gateway.config import check_config
from gateway.metadata import build_monitor, describe
from gateway.recording import Recorder
from gateway.records import Note, Raw, Record, Stamp, Status, Tick
from simulators.carriers import stream
from simulators.link import units
from simulators.scenario import white_mountains
from tests.gateway.made import GNSS, Bridge, position

HERE = Path(__file__).parent
TERRAIN = "simulators/data/terrain/N44W072.hgt"  # from the project's top
SECOND_NS = 1_000_000_000
MONOTONIC_NS, UTC_NS = 5000 * SECOND_NS, 1_780_000_000 * SECOND_NS
CHUNK_NS = 40_000_000
SECONDS = 10
STEP_AT_S, STEP_NS = 6, 250_000_000  # of the host's UTC


def stamp(time_ns: int) -> Stamp:
    step_ns = STEP_NS if time_ns >= STEP_AT_S * SECOND_NS else 0
    return Stamp(MONOTONIC_NS + time_ns, UTC_NS + time_ns + step_ns)


def chunks() -> Iterator[tuple[int, str, bytes]]:
    """What both bridges sent, with the time in ns at which it was read."""
    plan = white_mountains(float(SECONDS), seed=5)
    plan = plan.model_copy(update={"radar": plan.radar.model_copy(update={"step_deg": 3.0})})
    gathered: dict[int, bytes] = {}
    for time_ns, unit in units(plan, stream()):
        end_ns = (time_ns // CHUNK_NS + 1) * CHUNK_NS
        gathered[end_ns] = gathered.get(end_ns, b"") + unit
    yield from ((time_ns, "left", data) for time_ns, data in gathered.items())
    right = Bridge()
    for k in range(2, 2 * SECONDS):  # after the left one, whose position is then the one in use
        data = (right.hello(k / 2) if k % 8 == 2 else b"") + right.words(GNSS, k / 2, position())
        yield k * SECOND_NS // 2 + 7_000_000, "right", data + right.heartbeat(k / 2)


def records() -> Iterator[Record]:
    """Statuses, chunks, ticks and a note in the order of their times."""
    happened: list[tuple[int, str, object]] = [(k * SECOND_NS, "tick", None) for k in range(1, SECONDS + 1)]
    happened += [(time_ns, name, data) for time_ns, name, data in chunks() if time_ns > 0]
    happened.append((STEP_AT_S * SECOND_NS, "~note", f"UTC of the host stepped by {STEP_NS / 1e9:+.3f} s"))
    states = [(name, state) for name in ("left", "right") for state in ("OPENING", "UP")]
    for sequence, (name, state) in enumerate(states):
        yield Status(sequence, stamp(1000 * sequence), name, state)
    for sequence, (time_ns, name, what) in enumerate(sorted(happened, key=lambda h: h[:2]), start=len(states)):
        if isinstance(what, bytes):
            yield Raw(sequence, stamp(time_ns), name, what, 64 if name == "right" and time_ns > 8 * SECOND_NS else 0)
        elif isinstance(what, str):
            yield Note(sequence, stamp(time_ns), what)
        else:
            yield Tick(sequence, stamp(time_ns))


def main() -> None:
    config = check_config(
        {
            "adapters": [{"name": name, "source": f"serial:/dev/{name}"} for name in ("left", "right")],
            "terrain": [TERRAIN],
        },
        "golden",
    )
    recorder = Recorder(
        HERE / f"{sys.argv[1]}.mcap", {**describe(config, build_monitor(config)), "host": "golden", "boot": "golden"}
    )
    for record in records():
        recorder.append([record])
    recorder.close()


if __name__ == "__main__":
    main()
