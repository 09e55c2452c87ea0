"""`shadebus thresholds`: what a configuration of the test can promise."""

from pathlib import Path
from typing import Annotated

import typer


def thresholds(
    n: Annotated[list[int] | None, typer.Option("--n", min=1, help="number of pairs N_D; repeatable")] = None,
    sigma_c: Annotated[float | None, typer.Option(min=1e-6, help="sigma of a shadow centre, range bins")] = None,
    p_fa: Annotated[float | None, typer.Option(min=1e-12, max=0.5, help="probability of false alert")] = None,
    p_md: Annotated[float | None, typer.Option(min=1e-12, max=0.999, help="probability of missed detection")] = None,
    plot: Annotated[Path | None, typer.Option(help="picture (PNG) of the MDB against N_D to write")] = None,
) -> None:
    """Print T_D and the minimum detectable bias; without options, the six configurations of the paper's Table 2."""
    from rich.table import Table

    from gateway.errors import GatewayError
    from gateway.tables import plain_console
    from monitor.disparity import minimum_detectable_bias, threshold

    given = (n, sigma_c, p_fa, p_md)
    if any(value is not None for value in given) and None in given:
        raise GatewayError("give all of --n, --sigma-c, --p-fa and --p-md, or none of them for the paper's Table 2")
    rows = [(60, 2.0, a, m) for a, m in ((1e-1, 1e-5), (1e-3, 1e-3), (1e-5, 1e-1))]
    rows += [(120, 4.0, a, m) for _, _, a, m in rows]
    if n and sigma_c and p_fa and p_md:
        rows = [(count, sigma_c, p_fa, p_md) for count in n]
    table = Table(title="sigma_D = sqrt(2) sigma_C; alert if N_D T / sigma_D^2 > T_D")
    for heading in ("N_D", "sigma_C (bins)", "P_FA", "P_MD", "T_D", "MDB (bins)"):
        table.add_column(heading, justify="right")
    for count, sigma, alarm, missed in rows:
        bias = minimum_detectable_bias(count, sigma * 2**0.5, alarm, missed)
        limit = threshold(count, alarm)
        table.add_row(f"{count}", f"{sigma:g}", f"{alarm:.0e}", f"{missed:.0e}", f"{limit:.2f}", f"{bias:.2f}")
    plain_console().print(table)
    if plot:
        from gateway.mdb_plot import Configuration, plot_mdb

        plot_mdb(plot, [Configuration(*row) for row in rows])
