"""`shadebus verify`: whether recordings are sound."""

from pathlib import Path
from typing import Annotated

import typer


def verify(
    recordings: Annotated[list[Path], typer.Argument(help="recordings (MCAP), or directories of one session each")],
) -> None:
    """Check every CRC, every sequence, every gap between records and files, and every index.

    Exit code 0 if all are sound, 1 if not. Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.errors import GatewayError
    from gateway.recording import Recording
    from gateway.recording.verify import verify as look

    wrong = 0
    for path in recordings:
        try:
            recording = Recording(path)
            found = look(recording, stop.until)
        except (GatewayError, OSError) as error:  # the second while the index is looked at
            typer.echo(f"{path}: NOT sound: {error}")
            wrong += 1
            continue
        for line in [*found.remarks, *found.problems]:
            typer.echo(f"  {line}")
        if found.count > len(found.problems):
            typer.echo(f"  and {found.count - len(found.problems)} more problems")
        verdict = "sound" if not found.count else f"NOT sound: {found.count} problems, {found.missing} records missing"
        typer.echo(f"{path}: {found.records} records in {len(recording.files)} files: {verdict}")
        wrong += bool(found.count)
    raise typer.Exit(1 if wrong else 0)
