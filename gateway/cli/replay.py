"""`shadebus replay`: a recording through the same pipeline as live."""

import sys
from pathlib import Path
from typing import Annotated

import typer


def replay(
    recording: Annotated[Path, typer.Argument(help="recording (MCAP)")],
    speed: Annotated[float | None, typer.Option(min=0.001, help="times real time; as fast as possible if left")] = None,
    start: Annotated[float, typer.Option(min=0, help="seconds from the first record")] = 0.0,
    until: Annotated[float | None, typer.Option("--stop", min=0, help="seconds from the first record")] = None,
    json: Annotated[bool, typer.Option("--json", help="events as JSON lines, the same bytes as live")] = False,
    dem: Annotated[list[Path] | None, typer.Option(help="terrain instead of the recorded one; repeatable")] = None,
) -> None:
    """Replay a recording exactly.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.console import print_json, print_line
    from gateway.errors import GatewayError
    from gateway.metadata import recorded_config, recorded_monitor
    from gateway.recording import Recording
    from gateway.replay import replay as play

    source = Recording(recording)
    config = recorded_config(source.metadata)
    monitor = recorded_monitor(source.metadata, config, tuple(dem or ()))
    failures: list[str] = []
    emit = print_json if json else print_line
    play(source, config, monitor, emit, failures.append, speed=speed, start_s=start, stop_s=until, stop=stop)
    stop.obey()
    if source.torn:
        print(f"shadebus: {recording}: {source.torn}; every whole record was replayed", file=sys.stderr)
    if source.damaged:
        failures.append(f"{source.damaged} damaged records were skipped")
    if failures:
        raise GatewayError(f"{recording}: " + "; ".join(failures))
