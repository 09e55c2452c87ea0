"""`shadebus simulate`: a simulated flight as byte-exact bus traffic."""

import signal
from pathlib import Path
from typing import Annotated

import typer


def simulate(
    scenario: Annotated[Path | None, typer.Argument(help="scenario (TOML); the White Mountains flight if left")] = None,
    to: Annotated[str, typer.Option(help="pty, tcp:PORT (0 takes a free one) or file:PATH")] = "pty",
    speed: Annotated[float, typer.Option(min=0.01, help="times real time; a file is written at once")] = 1.0,
    seed: Annotated[int | None, typer.Option(min=0, help="instead of the scenario's")] = None,
    duration: Annotated[float | None, typer.Option(min=1, help="seconds of the first leg, instead of its own")] = None,
) -> None:
    """Send the traffic of a bridge with a weather radar, an IRU, a GNSS receiver and a radio altimeter."""
    from gateway.errors import GatewayError
    from simulators import outlets
    from simulators.player import play
    from simulators.scenario import load, white_mountains
    from simulators.traffic import traffic

    try:
        plan = load(scenario) if scenario else white_mountains()
    except (OSError, ValueError) as error:
        raise GatewayError(str(error)) from error
    if duration is not None:
        plan = plan.model_copy(update={"flight": plan.flight.model_copy(update={"duration_s": duration})})
    if seed is not None:
        plan = plan.model_copy(update={"seed": seed})

    kind, _, address = to.partition(":")
    outlet: outlets.PtyOutlet | outlets.TcpOutlet | outlets.FileOutlet
    try:
        if kind == "pty":
            outlet = outlets.PtyOutlet()
            typer.echo(f"serial:{outlet.path}")
        elif kind == "tcp":
            outlet = outlets.TcpOutlet(int(address or "0"))
            typer.echo("serial:socket://{}:{}".format(*outlet.address))
        elif kind == "file" and address:
            outlet = outlets.FileOutlet(Path(address))
            speed = float("inf")
        else:
            raise GatewayError(f"--to {to}: use pty, tcp:PORT or file:PATH")
    except (OSError, ValueError, OverflowError) as error:
        raise GatewayError(f"--to {to}: {error}") from error

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with outlet:
        try:
            played = play(traffic(plan), outlet, speed)
        except (OSError, ValueError) as error:
            raise GatewayError(f"simulation: {error}") from error
        except KeyboardInterrupt:  # the usual end of a simulation, also while it waits for a reader
            return
    typer.echo(
        f"{played.packets} packets, {played.size_bytes} bytes, at worst {played.worst_lateness_s * 1e3:.1f} ms late",
        err=True,
    )
