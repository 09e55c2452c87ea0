"""`shadebus reprocess`: many recordings, in parallel."""

from pathlib import Path
from typing import Annotated

import typer


def reprocess(
    directory: Annotated[Path, typer.Argument(help="where the recordings are, in directories below too")],
    output: Annotated[Path, typer.Option("--output", "-o", help="directory of the data set")],
    config: Annotated[Path | None, typer.Option("-c", "--config", help="rack file instead of the recorded one")] = None,
    dem: Annotated[list[Path] | None, typer.Option(help="terrain instead of the recorded one; repeatable")] = None,
    water: Annotated[list[Path] | None, typer.Option(help="water instead of the recorded one; repeatable")] = None,
    scheduler: Annotated[str | None, typer.Option(help="of a Dask cluster, such as tcp://127.0.0.1:8786")] = None,
) -> None:
    """Decode and judge all recordings below a directory again, on all cores of this machine or on a Dask cluster.

    The verdicts land in a Parquet data set. A second run does only what is new or has changed: the recording, the
    configuration, the terrain, the water, or this program.
    """
    import logging

    from gateway.reprocess.workers import get_ready

    logging.disable()  # whatever Dask says of its processes: what counts is told of each recording
    if not scheduler:
        get_ready()  # before all the rest is imported, which takes as long

    from rich.progress import Progress

    from gateway.errors import GatewayError
    from gateway.reprocess.dataset import DataSet
    from gateway.reprocess.job import jobs
    from gateway.reprocess.run import reprocess as bring_up_to_date
    from gateway.tables import plain_console, print_table

    given = None
    if config:
        from gateway.config import load_config  # which takes longer than all the rest

        given = load_config(config)
    listed = jobs(directory, given, dem or (), water or ())
    data = DataSet(output)
    with Progress(console=plain_console(), transient=True) as bar:
        task = bar.add_task("recordings", total=len(listed))
        done = bring_up_to_date(listed, data, scheduler, lambda n, total: bar.update(task, completed=n, total=total))
    rows, damaged = data.summary()
    headings = ("recording", "seconds", "ok", "alert", "unavailable", "damaged", "missing", "torn")
    print_table(headings, [[_text(row[name]) for name in headings] for row in rows])
    typer.echo(f"{len(done.made)} worked out, {done.kept} held already")
    if others := sorted(set(data.names()) - {job.name for job in listed}):
        typer.echo(f"results of recordings that are not below {directory} are left: {', '.join(others)}")
    problems = [f"{name}: {why}" for name, why in done.failed.items()]
    problems += [f"{row['recording']}: {failure}" for row in rows for failure in row["failures"]]
    problems += [f"{name}: its result cannot be read; delete {output}/*/{name}.parquet" for name in damaged]
    if problems:
        raise GatewayError("; ".join(problems))


def _text(value: object) -> str:
    return f"{value:.1f}" if isinstance(value, float) else str(value)
