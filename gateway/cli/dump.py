"""`shadebus dump`: the words of a recording as text."""

from pathlib import Path
from typing import Annotated

import typer


def dump(
    recording: Annotated[Path, typer.Argument(help="recording (MCAP)")],
    adapter: Annotated[list[str] | None, typer.Option(help="only of this adapter; repeatable")] = None,
    channel: Annotated[list[int] | None, typer.Option(min=0, max=255, help="only of this channel; repeatable")] = None,
    label: Annotated[
        list[str] | None, typer.Option(help="only ARINC 429 words of this label, octal; repeatable")
    ] = None,
) -> None:
    """Print one line a bus word, in the order they were recorded.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.metadata import recorded_config
    from gateway.recording import Recording
    from gateway.text import Wanted, lines

    source = Recording(recording)
    config = recorded_config(source.metadata, recording)
    wanted = Wanted.of(config, adapter or (), channel or (), label or ())
    for line in lines(stop.until(source), config, wanted):
        typer.echo(line)
    for text in source.complaints:
        typer.echo(f"shadebus: {recording}: {text}", err=True)
