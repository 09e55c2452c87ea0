"""`shadebus info`: what a recording holds."""

from pathlib import Path
from typing import Annotated

import typer

SHOWN_KEYS = (
    "terrain_checksum", "water_checksum", "shadebus", "numpy", "python", "host", "clock", "cut", "merged", "recovered",
)  # fmt: skip # of the metadata
SHOWN_PLACES = 10  # of the damaged ones; `verify` prints more


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
    from gateway.recording.keeper import NAME
    from gateway.records import Raw, Status
    from gateway.tables import plain_console

    source = Recording(recording)
    config = recorded_config(source.metadata, recording)
    pipeline = Pipeline(config, None)
    first = last = None
    raw_bytes, sync = 0, "nothing told"
    for record in stop.until(source):
        first, last = first or record.stamp, record.stamp
        raw_bytes += len(record.data) if isinstance(record, Raw) else 0
        if isinstance(record, Status) and (record.adapter, record.state) == (NAME, "CLOSED"):
            sync = record.reason
        for _ in pipeline.feed(record):
            pass
    table = Table("", Column(overflow="fold"), title=str(recording), show_header=False)
    size = sum(path.stat().st_size for path in source.files)
    table.add_row("size", f"{size} bytes, {raw_bytes} of them from the buses")
    table.add_row("files", ", ".join(path.name for path in source.files))
    table.add_row("format", source.metadata.get("format", "1"))
    if first and last:
        seconds = (last.monotonic_ns - first.monotonic_ns) / 1e9
        table.add_row("time", f"{clock(first.utc_ns)} to {clock(last.utc_ns)} UTC, {seconds:.1f} s")
    table.add_row("records", ", ".join([f"{source.records} whole", *source.losses]))
    for damage in source.damage[:SHOWN_PLACES]:
        table.add_row("damage", f"{damage.length} bytes at {damage.offset} of {damage.path.name}: {damage.what}")
    table.add_row("end", source.torn or "closed with its index")
    table.add_row("disk", sync)
    for adapter in config.adapters:
        table.add_row("adapter", f"{adapter.name}: {adapter.source}")
    table.add_row("terrain", ", ".join(str(path) for path in config.terrain) or "none")
    table.add_row("water", ", ".join(str(path) for path in config.water) or "none")
    for key in SHOWN_KEYS:
        if key in source.metadata:
            table.add_row(key, source.metadata[key])
    for event in pipeline.finish():
        for name, count in getattr(event, "counters", {}).items():
            if count:
                table.add_row(name, str(count))
    plain_console().print(table)
