"""A simulated flight as a recording."""

from pathlib import Path

from gateway.config import check_config
from gateway.metadata import build_monitor, describe
from gateway.recording import Recorder
from gateway.records import Raw, Record, Stamp, Status, Tick
from simulators.carriers import stream
from simulators.link import units
from simulators.scenario import BUILT_IN_TERRAIN, Radar, white_mountains

SWEEP_S = 61 * 3 / 40
CHUNK_NS = 20_000_000


def record_flight(path: Path, seed: int, sweeps: int = 2, **rack: object) -> None:
    """Record whole sweeps over the White Mountains; the flight's UTC begins `seed` ns after 1970."""
    table: dict[str, object] = {
        "adapters": [{"name": "bridge", "source": "serial:x"}],
        "terrain": [BUILT_IN_TERRAIN["white_mountains"]],
    }
    config = check_config({**table, **rack}, "test")
    scenario = white_mountains(sweeps * SWEEP_S, seed=seed).model_copy(update={"radar": Radar(step_deg=3.0)})
    chunks: dict[int, bytes] = {}
    for ready_ns, data in units(scenario, stream()):
        chunks[ready_ns // CHUNK_NS] = chunks.get(ready_ns // CHUNK_NS, b"") + data
    records: list[Record] = [Status(0, Stamp(0, seed), "bridge", "UP")]
    for chunk, data in chunks.items():
        stamp = Stamp(chunk * CHUNK_NS, chunk * CHUNK_NS + seed)
        records.append(Raw(len(records), stamp, "bridge", data))
        if chunk % 50 == 49:
            records.append(Tick(len(records), stamp))
    recorder = Recorder(path, describe(config, build_monitor(config)))
    recorder.append(records)
    recorder.close()
