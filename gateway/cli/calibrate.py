"""`shadebus calibrate radar | dem`: how much disparity is normal."""

from pathlib import Path
from typing import Annotated

import typer

Output = Annotated[Path, typer.Option("--output", "-o", help="file to write (JSON)")]
Report = Annotated[Path | None, typer.Option(help="directory for a page with the table and histograms")]
Rack = Annotated[Path | None, typer.Option("-c", "--config", help="rack file")]

MOST_SAID = 1000  # characters of a provenance, which names every recording


def calibrate_radar(
    recordings: Annotated[list[Path], typer.Argument(help="recordings, or directories with recordings below them")],
    output: Output,
    dem: Annotated[list[Path] | None, typer.Option(help="terrain instead of the recorded one; repeatable")] = None,
    water: Annotated[list[Path] | None, typer.Option(help="water instead of the recorded one; repeatable")] = None,
    config: Rack = None,
    report: Report = None,
    least_scans: Annotated[int, typer.Option(min=4, help="be content with so many scans")] = 1000,
) -> None:
    """Make the monitor's calibration file from recorded flights over terrain that is known to be right.

    Prints the residuals of shadow centres by size and range limit. Half of the scans are fitted, the other half checks
    how often each P_FA would have alerted.
    """
    from textwrap import shorten

    from rich.progress import track

    from gateway.calibrate.page import Results, write_page
    from gateway.calibrate.radar import EXPLANATION, HEADINGS, calibration, displacement, histograms, material, table
    from gateway.calibrate.recorded import read
    from gateway.calibrate.workers import on_all_cores
    from gateway.config import load_config
    from gateway.recording.session import sessions
    from gateway.reprocess.job import jobs
    from gateway.tables import plain_console, print_table

    # What is to be made need not be there yet.
    rack = load_config(config).model_copy(update={"calibration": None}) if config else None
    named = {job.path.resolve(): job for source in recordings for job in jobs(source, rack, dem or (), water or ())}
    listed = {first: named[first] for first, *_ in sessions(named)}  # which later files of a session come with
    results = on_all_cores(read, listed.values())
    reads = list(track(results, "recordings", len(listed), console=plain_console(), transient=True))
    for one in reads:
        if one.damage:
            typer.echo(f"{one.name}: {one.damage}; every whole record was used", err=True)
    found = material(reads)
    rows = table(found)
    print_table(HEADINGS, rows)
    if found.left_out:
        typer.echo(f"{found.left_out} scans left out: not of {found.setting}")
    made = calibration(output.stem, reads, found, least_scans)
    output.write_text(made.model_dump_json(indent=2) + "\n", encoding="utf-8")
    for rate in made.checked:
        typer.echo(f"P_FA {rate.p_fa:g}: {rate.alerts} alerts in the {rate.scans} scans that were not fitted")
    typer.echo(displacement(found, made))
    typer.echo(shorten(made.provenance, MOST_SAID, placeholder=f" ... (the rest stands in {output})"))
    if report:
        page = Results(f"Calibration {made.name}", made.provenance, EXPLANATION, HEADINGS, rows, histograms(found))
        typer.echo(f"report: {write_page(report, page)}")


def calibrate_dem(
    output: Output,
    dem: Annotated[list[Path] | None, typer.Option(help="terrain, unless the rack file names it; repeatable")] = None,
    config: Rack = None,
    at: Annotated[str | None, typer.Option(help="LAT,LON in degrees; the middle of the terrain if not given")] = None,
    heights_m: Annotated[
        str | None, typer.Option(help="above mean sea level, as 1600,1800; 250 to 1050 m above the ground if not given")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, max=10_000, help="for each height")] = 100,
    paper: Annotated[bool, typer.Option("--paper", help="as published: no fan, flat Earth, no bus")] = False,
    bins: Annotated[int | None, typer.Option(min=16, max=1024, help="range bins of the radar, 512")] = None,
    range_nm: Annotated[float | None, typer.Option(min=1, max=320, help="range setting of the radar, 10")] = None,
    tilt_deg: Annotated[float, typer.Option(min=-30, max=30, help="of the antenna")] = 0.0,
    post_noise_m: Annotated[float, typer.Option(min=0, max=1000, help="sigma of each post's error")] = 3.0,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    report: Report = None,
) -> None:
    """Find by Monte Carlo what errors of navigation, pointing and terrain do to predicted shadows.

    Prints the residuals of shadow edges, centres and sizes for each height.
    """
    import numpy as np
    from rich.progress import track

    from gateway.calibrate import dem as study
    from gateway.calibrate.page import Results, write_page
    from gateway.config import load_config
    from gateway.errors import GatewayError
    from gateway.tables import plain_console, print_table
    from monitor.monte_carlo import Variables
    from monitor.settings import MonitorSettings
    from monitor.terrain import open_terrain
    from monitor.terrain_files import TerrainError

    rack = load_config(config) if config else None
    if paper and (bins or range_nm):
        raise GatewayError("--paper has the paper's radar: leave --bins and --range-nm out")
    try:
        terrain = open_terrain(dem or (rack.terrain if rack else ()))
        place = study.place_of(terrain, at)
        true = Variables(place.latitude_deg, place.longitude_deg, tilt_deg=tilt_deg)
        settings = rack.monitor if rack else MonitorSettings()
        setup = study.setup_of(true, settings, bins or 512, range_nm or 10.0, post_noise_m, seed)
        setup = study.as_published(setup) if paper else setup
        here = terrain.around(np.array(place.latitude_deg), np.array(place.longitude_deg), setup.reach_m)
    except TerrainError as error:
        raise GatewayError(str(error)) from error
    heights = study.heights_of(heights_m, place)
    results = study.monte_carlo(here.grid, setup, heights, runs)
    found = list(track(results, "heights", len(heights), console=plain_console(), transient=True))
    rows, said = study.table(found), study.provenance(terrain, setup, runs)
    print_table(list(study.HEADINGS), rows)
    output.write_text(study.file_text(output.stem, said, found), encoding="utf-8")
    typer.echo(said)
    if report:
        page = Results(output.stem, said, study.EXPLANATION, list(study.HEADINGS), rows, study.histograms(found))
        typer.echo(f"report: {write_page(report, page)}")
