"""`shadebus merge`: several recordings as one."""

from pathlib import Path
from typing import Annotated

import typer


def merge(
    recordings: Annotated[list[Path], typer.Argument(help="recordings (MCAP), of one rack or of several")],
    out: Annotated[Path, typer.Option("-o", "--out", help="new file")],
) -> None:
    """Write the records of all by time to one file that replays; adapters of the same name are renamed.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143; nothing half done is left.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.recording import Recording
    from gateway.recording.merging import merge as merge_all

    for line in merge_all([Recording(path) for path in recordings], out, stop.until):
        typer.echo(line)
    typer.echo(f"written to {out}")
