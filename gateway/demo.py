"""The demo: three simulated legs over the White Mountains, each through a pseudo-terminal and the shipped gateway.

The gateway runs as its own process, exactly as on a rack; the demo only feeds the other end of the line, shows what the
gateway says, and afterwards replays each recording and compares the events byte for byte.
"""

import json
import math
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import rasterio
from pyproj import Geod
from rasterio.errors import RasterioError
from rasterio.transform import Affine
from rich.box import SIMPLE
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table
from rich.text import Text

from gateway import events
from gateway.config import profile_of
from gateway.errors import GatewayError
from gateway.metadata import recorded_config, recorded_monitor
from gateway.recording import Recording
from gateway.replay import replay
from gateway.report import Flown, Picture, write_report
from gateway.stopping import Stop
from gateway.tables import plain_console
from gateway.threads import GuardedThread
from gateway.warmup import COMPILING, compiled, warm_up_gateway
from monitor.comparison import Comparison
from monitor.integrity import Monitor
from monitor.scans import Scan
from monitor.terrain import open_terrain
from monitor.verdict import ALERT, OK, UNAVAILABLE, Verdict

SHIFT_EAST_M = 500.0
SWEEP_S = 361 / 80  # 361 radials at 80 a second
LEG_S = 12 * SWEEP_S
GNSS_FAILS_S = 18.0
P_FA = 1e-4
COLOURS = {OK: "green", ALERT: "red", UNAVAILABLE: "yellow"}
START_S, STOP_S = 60.0, 30.0  # a first start compiles the kernels
POLL_S = 0.1
CALIBRATION = Path(str(resources.files("simulators"))) / "data" / "demo_calibration.json"


@dataclass
class Leg:
    """One leg: its terrain, what fails in it, what the gateway should end up saying, and what it said."""

    name: str
    title: str
    terrain: Path
    expected: str
    faults: tuple[dict[str, Any], ...] = ()
    lines: list[str] = field(default_factory=list)
    listening: Event = field(default_factory=Event)
    deaf: list[BaseException] = field(default_factory=list)  # why nobody listens to the gateway any more
    recording: Path = Path()
    identical: bool = False

    @property
    def verdicts(self) -> list[dict[str, Any]]:
        """The integrity events, in order."""
        return [event for event in map(json.loads, self.lines) if event["type"] == "integrity"]

    @property
    def as_expected(self) -> bool:
        """Whether every scan said what it must: from the first that shows the fault on, nothing but the fault."""
        said = [event["verdict"] for event in self.verdicts]
        since = said.index(self.expected) if self.expected in said else len(said)
        latest = {OK: 0, ALERT: 1, UNAVAILABLE: math.ceil(GNSS_FAILS_S / SWEEP_S)}[self.expected]
        before = set(said[:since]) <= {OK}
        return bool(said) and since <= latest and before and set(said[since:]) == {self.expected}

    @property
    def outcome(self) -> str:
        """The verdict of the last scan."""
        return str(self.verdicts[-1]["verdict"]) if self.verdicts else "none"


def fly(out: Path, seed: int, speed: float, stop: Stop) -> None:
    """Fly the legs, print the table, write the report; `stop` ends all of it, the gateway's process included.

    Raises GatewayError if anything is not as it must be.
    """
    from simulators.scenario import BUILT_IN_TERRAIN

    console = plain_console()
    try:
        out.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=out).close()
    except OSError as error:
        raise GatewayError(f"cannot write to {out}: {error.strerror}; choose another directory with --out") from error
    true_terrain = BUILT_IN_TERRAIN["white_mountains"]
    try:
        shifted = shift_terrain(true_terrain, out / "shifted_500m_east.tif", east_m=SHIFT_EAST_M)
    except RasterioError as error:
        raise GatewayError(f"cannot write the shifted terrain to {out}: is the disk full?") from error
    failing = ({"name": "gnss_no_computed_data", "start_s": GNSS_FAILS_S},)
    legs = [
        Leg("true", "true terrain", true_terrain, "ok"),
        Leg("shifted", f"terrain {SHIFT_EAST_M:.0f} m east", shifted, "alert"),
        Leg("gnss", f"GNSS fails at {GNSS_FAILS_S:.0f} s", true_terrain, "unavailable", failing),
    ]
    console.print(
        f"Three legs of {LEG_S:.0f} s over the White Mountains at {speed:g} times real bus rates, P_FA {P_FA:g}"
    )
    if not compiled():
        console.print(COMPILING)
    warm_up_gateway(Monitor(open_terrain(true_terrain)))  # or the first gateway compiles before it hears anything
    flown = []
    for leg in legs:
        _live(leg, out, seed, speed, console, stop)
        flown.append(_again(leg, stop))
    _table(legs, console)
    report = write_report(out / "report", flown)
    console.print(f"recordings in {out}, report in {report}")
    wrong = [f"{leg.title}: not {leg.expected} as it must be" for leg in legs if not leg.as_expected]
    wrong += [f"{leg.title}: replay differs from live" for leg in legs if not leg.identical]
    if wrong:
        raise GatewayError("the demo did not come out as it must: " + "; ".join(wrong))
    console.print("replayed: the events of all three recordings are identical to the live ones, byte for byte")


def shift_terrain(terrain: Path, target: Path, *, east_m: float = 0.0, north_m: float = 0.0, up_m: float = 0.0) -> Path:
    """Write a copy of a terrain file whose content lies so many metres farther away, measured at its middle."""
    with rasterio.open(terrain) as source:
        t = source.transform
        latitude, geod = t.f + t.e * source.height / 2, Geod(ellps="WGS84")
        east_deg = east_m / geod.inv(0, latitude, 1, latitude)[2]
        north_deg = north_m / geod.inv(0, latitude - 0.5, 0, latitude + 0.5)[2]
        heights = source.read(masked=True).astype("float32") + np.float32(up_m)
        profile = {
            **source.profile,
            "driver": "GTiff",
            "dtype": "float32",
            "transform": Affine(t.a, 0, t.c + east_deg, 0, t.e, t.f + north_deg),
        }
        with rasterio.open(target, "w", **profile) as copy:
            copy.write(heights.filled(source.nodata))
    return target


def _live(leg: Leg, out: Path, seed: int, speed: float, console: Console, stop: Stop) -> None:
    from simulators.carriers import stream
    from simulators.link import units
    from simulators.outlets import PtyOutlet
    from simulators.player import play
    from simulators.scenario import Fault, white_mountains

    scenario = white_mountains(LEG_S, seed).model_copy(update={"faults": tuple(Fault(**f) for f in leg.faults)})
    console.rule(leg.title)
    with PtyOutlet() as line:
        config = out / f"{leg.name}.toml"
        config.write_text(_rack(line.path, leg.terrain, out / leg.name))
        longest_s = START_S + LEG_S / speed + STOP_S
        with Progress(console=console) as bar, _gateway(leg, config, longest_s, console) as gateway:
            task = bar.add_task(leg.title, total=math.ceil(LEG_S))
            _wait_until_it_listens(leg, gateway, stop)
            play(stop.until(_shown(units(scenario, stream()), leg, bar, task)), line, speed)
            line.drain()
            gateway.send_signal(signal.SIGTERM)
            code = gateway.wait(STOP_S)
    if code:
        raise GatewayError(f"leg {leg.title}: the gateway ended with exit code {code}")
    leg.recording = max((out / leg.name).glob("*.mcap"))


@contextmanager
def _gateway(leg: Leg, config: Path, longest_s: float, console: Console) -> "Iterator[subprocess.Popen[str]]":
    """The shipped gateway as a process that does not outlive the block, nor `longest_s` if the demo itself is killed.

    Ctrl-C at the terminal does not reach it, so that it ends in one way only.
    """
    command = [sys.executable, "-m", "gateway", "run", "-c", str(config), "--json", "--for", f"{longest_s:.0f}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, process_group=0) as gateway:  # noqa: S603 # our own command
        reader = GuardedThread(
            "reader", lambda: _listen(leg, gateway, console), lambda _, error: leg.deaf.append(error)
        )
        reader.start()
        try:
            yield gateway
        finally:
            gateway.kill()  # has no effect on one that has ended
            reader.join()


def _wait_until_it_listens(leg: Leg, gateway: "subprocess.Popen[str]", stop: Stop) -> None:
    deadline = time.monotonic() + START_S
    while not leg.listening.wait(POLL_S):
        stop.obey()
        if gateway.poll() is not None:
            raise GatewayError(f"leg {leg.title}: the gateway ended with exit code {gateway.returncode}")
        if time.monotonic() > deadline:
            raise GatewayError(f"leg {leg.title}: the gateway did not open its line within {START_S:.0f} s")


def _rack(device: str, terrain: Path, directory: Path) -> str:
    return "\n".join(
        (
            f"terrain = [{json.dumps(str(terrain.absolute()))}]",
            f"calibration = {json.dumps(str(CALIBRATION))}",
            "[[adapters]]",
            'name = "bridge"',
            f'source = "serial:{device}"',
            "[recording]",
            f"directory = {json.dumps(str(directory.absolute()))}",
            "[monitor]",
            f"p_fa = {P_FA:g}",
            "",
        )
    )


def _listen(leg: Leg, gateway: "subprocess.Popen[str]", console: Console) -> None:
    """Keep every event line, and show verdicts as they come."""
    for line in gateway.stdout or ():
        if not line.endswith("\n"):
            break  # cut short by a kill
        leg.lines.append(line)
        event = json.loads(line)
        if event["type"] == "status" and event["state"] == "UP":
            leg.listening.set()
        elif event["type"] == "integrity":
            figures = f"N {event['n_pairs']:3d}"
            if event["threshold"] is not None:
                figures += f"  Q {event['q']:6.1f} against {event['threshold']:.1f}"
            if event["shift_limit"] is not None and event["shift"] is not None:
                figures += f"  S {event['shift']:6.1f} against {event['shift_limit']:.1f}"
            why = "" if event["verdict"] == OK else f"  {event['reasons'][0]}"
            verdict = Text(event["verdict"], COLOURS[event["verdict"]])
            console.print(Text.assemble(f"scan {event['scan']:2d}  ", verdict, f"  {figures}{why}"))


def _shown(packets: Iterator[tuple[int, bytes]], leg: Leg, bar: Progress, task: TaskID) -> Iterator[tuple[int, bytes]]:
    """The same packets, and the bar moved to their time; raises what has ended the listening."""
    for time_ns, data in packets:
        if leg.deaf:
            raise leg.deaf[0]
        bar.update(task, completed=time_ns / 1e9)
        yield time_ns, data
    bar.update(task, completed=math.ceil(LEG_S))


def _again(leg: Leg, stop: Stop) -> Flown:
    """Replay the leg's recording, compare the events with the live ones, and keep what the report needs."""
    recording = Recording(leg.recording)
    config = recorded_config(recording.metadata)
    monitor = recorded_monitor(recording.metadata, config)
    if monitor is None:
        raise GatewayError(f"{leg.recording} was made without terrain")
    replayed: list[events.Event] = []
    pictures: list[Picture] = []
    failures: list[str] = []

    def watch(scan: Scan, verdict: Verdict, comparison: Comparison | None) -> None:
        complete_ns = replayed[-1].time_ns  # the event before a verdict says that its scan is complete
        pictures.append(Picture(complete_ns, scan, verdict, comparison))

    replay(recording, config, monitor, replayed.append, failures.append, watcher=watch, stop=stop)
    stop.obey()
    leg.identical = [event.to_json() + "\n" for event in replayed] == leg.lines and not failures
    profile = profile_of(config.radar_profile)
    return Flown(leg.title, recording, monitor, profile, replayed[0].time_ns, replayed[-1].time_ns, pictures)


def _table(legs: list[Leg], console: Console) -> None:
    table = Table("leg", OK, ALERT, "unavail.", "pairs", "last verdict", "replay", box=SIMPLE)
    for leg in legs:
        count = Counter(event["verdict"] for event in leg.verdicts)
        pairs = sorted(event["n_pairs"] for event in leg.verdicts) or [0]
        table.add_row(
            leg.title,
            *(str(count[verdict]) for verdict in (OK, ALERT, UNAVAILABLE)),
            f"{pairs[0]} to {pairs[-1]}",
            Text(leg.outcome, COLOURS.get(leg.outcome, "white")).append(
                "" if leg.as_expected else f", expected {leg.expected}", "default"
            ),
            "identical" if leg.identical else "DIFFERS",
        )
    console.print(table)
