"""`shadebus replay`: a recording through the same pipeline as live."""

import sys
from pathlib import Path
from typing import Annotated

import typer


def replay(
    recording: Annotated[Path, typer.Argument(help="recording (MCAP)")],
    speed: Annotated[str, typer.Option(help="times real time, or max: as fast as possible")] = "max",
    start: Annotated[float, typer.Option(min=0, help="seconds from the first record")] = 0.0,
    until: Annotated[float | None, typer.Option("--stop", min=0, help="seconds from the first record")] = None,
    step: Annotated[bool, typer.Option("--step", help="wait for Enter before each scan and its verdict")] = False,
    loop: Annotated[int, typer.Option(min=0, help="so many times; 0 for ever. Each time begins anew")] = 1,
    rename: Annotated[list[str] | None, typer.Option(help="OLD=NEW, another name for an adapter; repeatable")] = None,
    json: Annotated[bool, typer.Option("--json", help="events as JSON lines, the same bytes as live")] = False,
    dem: Annotated[list[Path] | None, typer.Option(help="terrain instead of the recorded one; repeatable")] = None,
    water: Annotated[list[Path] | None, typer.Option(help="water instead of the recorded one; repeatable")] = None,
) -> None:
    """Replay a recording exactly.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from itertools import count, islice

    from gateway.console import print_json, print_line
    from gateway.errors import GatewayError
    from gateway.metadata import recorded_config, recorded_monitor
    from gateway.playback import Steps, names_of, renamed, speed_of
    from gateway.recording import Recording
    from gateway.replay import replay as play

    times = speed_of(speed)
    source = Recording(recording)
    config = recorded_config(source.metadata, recording)
    names = names_of(rename or [], config)
    config = renamed(config, names)
    steps = Steps().wait if step else None
    failures: list[str] = []
    emit = print_json if json else print_line
    for _ in islice(count(), loop or None):
        monitor = recorded_monitor(source.metadata, config, tuple(dem or ()), tuple(water or ()))
        play(
            source,
            config,
            monitor,
            emit,
            failures.append,
            speed=times,
            start_s=start,
            stop_s=until,
            stop=stop,
            names=names,
            step=steps,
        )
        stop.obey()
        if not source.records:
            break
    if source.torn:
        print(f"shadebus: {recording}: {source.torn}; every whole record was replayed", file=sys.stderr)
    if problems := failures + source.losses:
        raise GatewayError(f"{recording}: " + "; ".join(problems))
