"""Tables for a terminal or a report."""

from collections.abc import Iterable, Sequence

from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

WIDEST = 300  # characters


def plain_console(width: int | None = None) -> Console:
    """A console that prints text as it stands: what came from a bus or a file is never markup. Width as the terminal's.

    Colours are given as rich's Text.
    """
    return Console(width=width, markup=False, emoji=False, highlight=False)


def print_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A Markdown table on stdout, as wide as it must be, whatever the terminal."""
    table = Table(*columns, box=MARKDOWN)
    for row in rows:
        table.add_row(*row)
    plain_console(WIDEST).print(table)
