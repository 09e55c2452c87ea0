"""`shadebus decode`: one word, explained field by field."""

from typing import Annotated

import typer


def decode_429(
    words: Annotated[list[str], typer.Argument(help="32-bit words in hexadecimal, bit 1 the least significant")],
    definitions: Annotated[str, typer.Option("--set", help="label set by name, or a TOML file of one")] = "iru_704",
    orientation: Annotated[str, typer.Option(help="wire or label_swapped")] = "wire",
) -> None:
    """Explain ARINC 429 words."""
    from gateway.explain import explain_429

    _print("ARINC 429", [explain_429(word, definitions, orientation) for word in words])


def decode_708(
    word: Annotated[str, typer.Argument(help="200 bytes in hexadecimal, or the 8 of the header alone")],
    profile: Annotated[str, typer.Option(help="arinc708, arinc708a or wxr2100_6bit")] = "arinc708",
) -> None:
    """Explain an ARINC 708 radar word."""
    from gateway.explain import explain_708

    _print("ARINC 708", [explain_708(word, profile)])


def _print(title: str, explained: list[list[tuple[str, str, str, str]]]) -> None:
    from rich.console import Console
    from rich.table import Table

    for rows in explained:
        table = Table("field", "bits", "code", "meaning", title=title)
        for row in rows:
            table.add_row(*row)
        Console().print(table)
