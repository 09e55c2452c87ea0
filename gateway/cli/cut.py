"""`shadebus cut`: a part of a recording."""

from pathlib import Path
from typing import Annotated

import typer


def cut(
    recording: Annotated[Path, typer.Argument(help="recording (MCAP); the first file stands for its session")],
    out: Annotated[Path, typer.Option("-o", "--out", help="new file")],
    start: Annotated[str | None, typer.Option(help="seconds from the first record, or UTC in ISO 8601")] = None,
    until: Annotated[str | None, typer.Option("--stop", help="likewise")] = None,
) -> None:
    """Write the records of a time to a file of its own.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143; nothing half done is left.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.recording import Recording
    from gateway.recording.cutting import cut as cut_out
    from gateway.recording.cutting import moment

    source = Recording(recording)
    limits = (moment(start) if start is not None else None, moment(until) if until is not None else None)
    typer.echo(f"{cut_out(source, stop.until(source), *limits, out)} records written to {out}")
    for text in source.complaints:
        typer.echo(f"shadebus: {recording}: {text}", err=True)
