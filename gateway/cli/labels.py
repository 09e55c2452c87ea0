"""`shadebus labels`: the label definitions that words are read by."""

import sys
from typing import Annotated

import typer

WIDE = 240  # characters, for a file or a pipe


def labels(
    name: Annotated[str | None, typer.Option("--set", help="label set by name, or a TOML file of one")] = None,
) -> None:
    """List the label sets, or every label of one with its bits, range, LSB, interval and source."""
    from rich.console import Console
    from rich.table import Table

    from gateway.explain import LABEL_HEADINGS, SET_HEADINGS, label_rows, set_rows

    table = Table(*(LABEL_HEADINGS if name else SET_HEADINGS))
    for row in label_rows(name) if name else set_rows():
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)
