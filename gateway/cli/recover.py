"""`shadebus recover`: a whole recording from a torn or damaged one."""

from pathlib import Path
from typing import Annotated

import typer


def recover(
    recording: Annotated[Path, typer.Argument(help="recording (MCAP); the first file stands for its session")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="new file; NAME.recovered.mcap if left")] = None,
) -> None:
    """Write all that is whole to a new file with an index, and a note of what was lost.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143; nothing half done is left.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.recording import Recording
    from gateway.recording.recover import recover as mend

    source = Recording(recording)
    target = out or source.files[0].with_suffix(".recovered.mcap")
    typer.echo(mend(source, stop.until(source), target))
    typer.echo(f"written to {target}")
