"""`shadebus doctor`: what this machine lacks to run on the rack."""

from pathlib import Path
from typing import Annotated

import typer


def doctor(record: Annotated[Path, typer.Option(help="where recordings are to go")] = Path()) -> None:
    """Check this machine and print the command that mends what it lacks; exit 1 if it lacks anything."""
    from rich.table import Column, Table
    from rich.text import Text

    from gateway.doctor import examine
    from gateway.tables import plain_console

    table = Table("check", "", Column("seen", overflow="fold"))
    findings = examine(record)
    for finding in findings:
        mark = Text("good", "green") if finding.good else Text("lacks", "red")
        table.add_row(finding.check, mark, finding.seen)
    plain_console().print(table)
    lacking = [finding for finding in findings if not finding.good]
    for finding in lacking:  # whole lines, to be copied from any terminal
        typer.echo(f"{finding.check}: {finding.mend}")
    if lacking:
        raise typer.Exit(1)
