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
    from gateway.tables import print_table

    for word in words:
        print_table(("field", "bits", "code", "meaning"), explain_429(word, definitions, orientation))


def decode_708(
    word: Annotated[str, typer.Argument(help="200 bytes in hexadecimal; the 8 of the header are enough")],
    profile: Annotated[str, typer.Option(help="arinc708, arinc708a, wxr2100_6bit, or a TOML file")] = "arinc708",
) -> None:
    """Explain an ARINC 708 radar word."""
    from gateway.explain import explain_708
    from gateway.tables import print_table

    print_table(("field", "bits", "code", "value", "unit", "note"), explain_708(word, profile))
