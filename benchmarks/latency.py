"""How soon a verdict comes: the real command on a pseudo-terminal at real bus rates. `make latency`.

Prints how long --help takes, the time from the start of the process to its open line, and from the first word after
each full scan to the scan's verdict. Run it twice: the first start on a machine compiles the kernels.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from threading import Thread

from simulators.carriers import stream
from simulators.link import units
from simulators.outlets import PtyOutlet
from simulators.player import play
from simulators.scenario import white_mountains

SWEEP_NS = 361 * 12_500_000  # 361 radials, 80 a second
SWEEPS = 4
HELP_RUNS = 5


def main() -> None:
    """Run the gateway, feed it, and compare times on one clock."""
    scenario = white_mountains(duration_s=(SWEEPS + 0.1) * SWEEP_NS / 1e9)
    seen: dict[str, float] = {}
    written: dict[int, float] = {}
    with PtyOutlet() as line:
        source, dem = f"serial:{line.path}", str(scenario.world.path)
        command = [sys.executable, "-m", "gateway", "run", "--json", "--source", source, "--dem", dem]
        began = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as gateway:  # noqa: S603 # our own command
            reader = Thread(target=_listen, args=(gateway, seen))
            reader.start()
            while "open" not in seen:
                time.sleep(0.01)
            play(_timed(units(scenario, stream()), written), line)
            line.close()
            gateway.send_signal(signal.SIGTERM)
            reader.join()
    print(f"shadebus --help: {min(_help() for _ in range(HELP_RUNS)):.2f} s, the best of {HELP_RUNS}")
    print(f"process start to open line: {seen['open'] - began:.2f} s")
    for sweep in range(SWEEPS):
        delay_ms = (seen[f"scan {sweep}"] - written[sweep]) * 1e3
        print(f"first word after scan {sweep} written to its verdict on stdout: {delay_ms:.1f} ms")


def _help() -> float:
    began = time.monotonic()
    subprocess.run([sys.executable, "-m", "gateway", "--help"], check=True, capture_output=True)  # our own
    return time.monotonic() - began


def _timed(packets: Iterator[tuple[int, bytes]], written: dict[int, float]) -> Iterator[tuple[int, bytes]]:
    """The same packets; notes when the first radar word after each sweep, which ends it, has been handed over."""
    for time_ns, data in packets:
        yield time_ns, data
        sweep = (time_ns - 2_000_000) // SWEEP_NS - 1
        if sweep >= 0:
            written.setdefault(sweep, time.monotonic())


def _listen(gateway: "subprocess.Popen[str]", seen: dict[str, float]) -> None:
    for text in gateway.stdout or ():
        event = json.loads(text)
        if event["type"] == "status" and event["state"] == "UP":
            seen["open"] = time.monotonic()
        elif event["type"] == "integrity":
            seen.setdefault(f"scan {event['scan']}", time.monotonic())


if __name__ == "__main__":
    main()
