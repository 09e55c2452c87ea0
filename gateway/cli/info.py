"""`shadebus info`: what a recording holds."""

from pathlib import Path
from typing import Annotated

import typer


def info(recording: Annotated[Path, typer.Argument(help="recording (MCAP)")]) -> None:
    """Print times, adapters, counters, versions and the state of the file.

    Ctrl-C ends it early with exit code 130, SIGTERM with 143.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from rich.table import Column, Table

    from gateway.console import clock
    from gateway.metadata import recorded_config
    from gateway.pipeline import Pipeline
    from gateway.recording import Recording
    from gateway.records import Raw
    from gateway.tables import plain_console

    source = Recording(recording)
    config = recorded_config(source.metadata)
    pipeline = Pipeline(config, None)
    first = last = None
    raw_bytes = 0
    for record in stop.until(source):
        first, last = first or record.stamp, record.stamp
        raw_bytes += len(record.data) if isinstance(record, Raw) else 0
        for _ in pipeline.feed(record):
            pass
    table = Table("", Column(overflow="fold"), title=str(recording), show_header=False)
    table.add_row("size", f"{recording.stat().st_size} bytes, {raw_bytes} of them from the buses")
    if first and last:
        seconds = (last.monotonic_ns - first.monotonic_ns) / 1e9
        table.add_row("time", f"{clock(first.utc_ns)} to {clock(last.utc_ns)} UTC, {seconds:.1f} s")
    table.add_row("records", f"{source.records} whole, {source.damaged} damaged")
    table.add_row("end", source.torn or "closed with its index")
    for adapter in config.adapters:
        table.add_row("adapter", f"{adapter.name}: {adapter.source}")
    table.add_row("terrain", ", ".join(str(path) for path in config.terrain) or "none")
    for key in ("terrain_checksum", "shadebus", "numpy", "python", "host"):
        table.add_row(key, source.metadata.get(key, ""))
    for event in pipeline.finish():
        for name, count in getattr(event, "counters", {}).items():
            if count:
                table.add_row(name, str(count))
    plain_console().print(table)
