"""`shadebus export`: a recording in other people's formats."""

import sys
from pathlib import Path
from typing import Annotated

import typer


def export(
    recording: Annotated[Path, typer.Argument(help="recording (MCAP)")],
    form: Annotated[str, typer.Option("--to", help="cfradial, chapter10, parquet, candump or csv")],
    output: Annotated[Path, typer.Option("--output", "-o", help="file, or directory, that is not there yet")],
    dem: Annotated[list[Path] | None, typer.Option(help="terrain instead of the recorded one; repeatable")] = None,
    without_terrain: Annotated[bool, typer.Option(help="judge nothing: every verdict is unavailable")] = False,
) -> None:
    """Write a recording in another format; say what was written, and what was left out.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143; then nothing is left at the output's path.
    """
    from gateway.stopping import Stop

    stop = Stop(patience_s=None)  # what is half written is taken away; before the imports that take their time
    from gateway.exports import export as write

    said = write(recording, form, output, stop, tuple(dem or ()), without_terrain)
    typer.echo(said[0])
    for line in said[1:]:
        print(f"shadebus: {recording}: {line}", file=sys.stderr)
