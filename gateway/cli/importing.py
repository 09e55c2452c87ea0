"""`shadebus import`: the files of other recorders as a recording."""

from pathlib import Path
from typing import Annotated

import typer


def import_(
    files: Annotated[list[Path], typer.Argument(help="pieces of one file in order; of mxf, a file for each channel")],
    layout: Annotated[str, typer.Option("--from", help="seqrecord, mxf, rdr4b or candump")],
    out: Annotated[Path, typer.Option("-o", "--out", help="the recording to make (MCAP); never overwritten")],
    channel: Annotated[
        list[str] | None, typer.Option(help="N=arinc429:SET[:label_swapped] or N=arinc708[:PROFILE]; repeatable")
    ] = None,
    config: Annotated[Path | None, typer.Option("-c", "--config", help="rack file: channels, terrain, monitor")] = None,
    start_utc: Annotated[str | None, typer.Option(help="UTC of the first record, such as 2026-05-28T12:00:00Z")] = None,
    tick_ns: Annotated[int | None, typer.Option(min=1, help="ns a tick of the card's clock")] = None,
    words_per_s: Annotated[
        float | None, typer.Option(help="of rdr4b, which has no times: 1 to 1e6; 190 if left")
    ] = None,
    size_bits: Annotated[int | None, typer.Option(help="bits of a unit of mxf's dataSize: 1, 8 or 16")] = None,
    flag: Annotated[
        list[str] | None, typer.Option(help="429.NAME=MASK or 708.NAME=MASK: the card's bits of an error; repeatable")
    ] = None,
) -> None:
    """Make a recording of files that other recorders have written; their bytes are kept as they are.

    NAME of --flag is parity, coding, word_length or sync. Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.errors import GatewayError
    from gateway.imports.plan import LAYOUTS, Wish, channels_of, flags_of, utc_ns
    from gateway.imports.run import import_files

    if layout not in LAYOUTS:
        raise GatewayError(f"--from {layout}: use one of {', '.join(LAYOUTS)}")
    said = {"tick_ns": tick_ns, "words_per_s": words_per_s, "size_bits": size_bits}
    vendor = {name: value for name, value in said.items() if value is not None} | flags_of(flag or [])
    start_ns = utc_ns(start_utc) if start_utc else None
    wish = Wish(files, layout, channels_of(channel or []), vendor, config, start_ns)
    counters = import_files(wish, out, stop.until)
    for name, count in counters.items():
        if count:
            typer.echo(f"{name} {count}")
