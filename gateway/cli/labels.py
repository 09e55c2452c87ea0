"""`shadebus labels`: the label definitions that words are read by."""

from typing import Annotated

import typer


def labels(
    name: Annotated[str | None, typer.Option("--set", help="label set by name, or a TOML file of one")] = None,
) -> None:
    """List the label sets, or every label of one with its bits, range, LSB, interval and source."""
    from gateway.explain import LABEL_HEADINGS, SET_HEADINGS, label_rows, set_rows
    from gateway.tables import print_table

    if name:
        print_table(LABEL_HEADINGS, label_rows(name))
    else:
        print_table(SET_HEADINGS, set_rows())
