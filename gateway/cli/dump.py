"""`shadebus dump`: the words of a recording as text."""

from pathlib import Path
from typing import Annotated

import typer


def dump(recording: Annotated[Path, typer.Argument(help="recording (MCAP)")]) -> None:
    """Print one line a bus word, in the order they were recorded.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.metadata import recorded_config
    from gateway.recording import Recording
    from gateway.text import lines

    source = Recording(recording)
    config = recorded_config(source.metadata)
    for line in stop.until(lines(source, config)):
        typer.echo(line)
    if source.torn:
        typer.echo(f"shadebus: {recording}: {source.torn}", err=True)
