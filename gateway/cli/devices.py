"""`shadebus devices`: what is plugged in."""

from typing import Annotated

import typer


def devices(json: Annotated[bool, typer.Option("--json", help="JSON lines")] = False) -> None:
    """List serial lines, USB bridges and CAN interfaces, each with the `source` for a rack file."""
    from json import dumps

    from gateway.devices import Device, plugged_in
    from gateway.tables import print_table

    found, absent = plugged_in()
    if json:
        for one in found:
            typer.echo(dumps(one._asdict()))
    elif found:
        print_table([name.replace("_", " ") for name in Device._fields], found)
    for sentence in absent:
        typer.echo(sentence, err=True)
