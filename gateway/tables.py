"""Tables for a report."""

from collections.abc import Iterable, Sequence

from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

WIDEST = 300  # characters


def print_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A Markdown table on stdout, as wide as it must be, whatever the terminal."""
    table = Table(*columns, box=MARKDOWN)
    for row in rows:
        table.add_row(*row)
    Console(width=WIDEST).print(table)
