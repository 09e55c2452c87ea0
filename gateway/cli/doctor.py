"""`shadebus doctor`: what this machine lacks to run on the rack."""

from pathlib import Path
from typing import Annotated

import typer


def doctor(record: Annotated[Path, typer.Option(help="where recordings are to go")] = Path()) -> None:
    """Check this machine and print the command that mends what it lacks; exit 1 if it lacks anything."""
    from rich.console import Console
    from rich.table import Table

    from gateway.doctor import examine

    table = Table("check", "", "seen", "mend")
    findings = examine(record)
    for finding in findings:
        mark = "[green]good[/]" if finding.good else "[red]lacks[/]"
        table.add_row(finding.check, mark, finding.seen, "" if finding.good else finding.mend)
    Console().print(table)
    if not all(finding.good for finding in findings):
        raise typer.Exit(1)
