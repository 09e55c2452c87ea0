"""Gateways to be killed: a process that has everything imported and compiled forks one for each line on its stdin.

A line is JSON: the arguments of `be_a_gateway`. The answer is the process's number. `make crash` has the most of them.
"""

import json
import mmap
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gateway.config import check_config
from gateway.core import CoreQueue
from gateway.events import Event
from gateway.metadata import build_monitor
from gateway.records import Raw, Record
from gateway.service import Service
from monitor.integrity import Monitor
from monitor.terrain import open_terrain
from monitor.warmup import warm_up
from simulators.scenario import BUILT_IN_TERRAIN

TERRAIN = BUILT_IN_TERRAIN["white_mountains"]
CHANNELS = {
    "0": {"kind": "arinc708"},
    **{
        str(k): {"kind": "arinc429", "definitions": d}
        for k, d in enumerate(("gnss_743a", "iru_704", "ra_707", "adc_706"), 1)
    },
}
ACCEPTED, EVENTS, RECORDINGS = "accepted", "events.jsonl", "recordings"


def be_a_gateway(device: str, directory: str, rotate_mib: float) -> None:
    """Run for ever; note in shared memory how many bytes were passed on, and every event before the next."""
    place = Path(directory)
    with (place / ACCEPTED).open("r+b") as file:
        accepted = mmap.mmap(file.fileno(), 8)
    log = os.open(place / EVENTS, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    deliver = CoreQueue.deliver

    def counted(self: CoreQueue, records: list[Record]) -> None:
        count = int.from_bytes(accepted[:8], "little")
        accepted[:8] = (count + sum(len(r.data) for r in records if isinstance(r, Raw))).to_bytes(8, "little")
        deliver(self, records)

    def emit(event: Event) -> None:
        os.write(log, event.to_json().encode() + b"\n")

    CoreQueue.deliver = counted  # type: ignore[method-assign] # what has come here was written before
    rack = check_config(
        {
            "adapters": [{"name": "bridge", "source": device, "channels": CHANNELS}],
            "terrain": [TERRAIN],
            "recording": {"directory": place / RECORDINGS, "rotate_mib": rotate_mib, "sync_interval_s": 0.05},
        },
        "crash",
    )
    service = Service(rack, build_monitor(rack), emit)
    service.start()
    service.broken.wait()


class Nursery:
    """The process that forks gateways."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    def gateway(self, device: str, directory: Path, rotate_mib: float) -> int:
        """Start one; its process number."""
        assert self._process.stdin and self._process.stdout
        (directory / ACCEPTED).write_bytes(bytes(8))
        self._process.stdin.write(json.dumps([device, str(directory), rotate_mib]) + "\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())

    def ended(self) -> str:
        """Wait for the end of the gateway; how it ended, as waitpid says."""
        assert self._process.stdout
        return self._process.stdout.readline().strip()


@contextmanager
def nursery() -> Iterator[Nursery]:
    command = [sys.executable, "-m", "tests.gateway.crashing"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Nursery(process)
        finally:
            assert process.stdin
            process.stdin.close()


def main() -> None:
    warm_up(Monitor(open_terrain((TERRAIN,))))
    for line in sys.stdin:
        child = os.fork()
        if not child:
            be_a_gateway(*json.loads(line))
            os._exit(1)
        print(child, flush=True)  # noqa: T201 # the answer
        print(os.waitpid(child, 0)[1], flush=True)  # noqa: T201 # and the end


if __name__ == "__main__":
    main()
