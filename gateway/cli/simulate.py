"""`shadebus simulate`: a simulated flight as byte-exact bus traffic."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

PLACES = "pty, tcp:PORT (0 takes a free one), file:PATH, udp:HOST:PORT, slcan or can:INTERFACE:CHANNEL"
UNITS = {"stream": "packets", "datagram": "datagrams", "can": "frames", "slcan": "lines"}


def simulate(
    scenario: Annotated[Path | None, typer.Argument(help="scenario (TOML); the White Mountains flight if left")] = None,
    to: Annotated[
        str,
        typer.Option(help=PLACES),
    ] = "pty",
    speed: Annotated[float, typer.Option(min=0.01, help="times real time; a file is written at once")] = 1.0,
    seed: Annotated[int | None, typer.Option(min=0, help="instead of the scenario's")] = None,
    duration: Annotated[float | None, typer.Option(min=1, help="seconds of the first leg, instead of its own")] = None,
) -> None:
    """Send the traffic of a bridge with a weather radar, an IRU, a GNSS receiver and a radio altimeter.

    Ctrl-C or SIGTERM ends it in good order.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.errors import GatewayError
    from simulators.faults.plug import plugged
    from simulators.link import units
    from simulators.outlets import FileOutlet
    from simulators.outlets.named import named
    from simulators.player import play
    from simulators.scenario import load, white_mountains

    try:
        plan = load(scenario) if scenario else white_mountains()
    except (OSError, ValueError) as error:
        raise GatewayError(str(error)) from error
    if duration is not None:
        plan = plan.model_copy(update={"flight": plan.flight.model_copy(update={"duration_s": duration})})
    if seed is not None:
        plan = plan.model_copy(update={"seed": seed})

    try:
        outlet, carrier = named(to)
    except (OSError, ValueError) as error:
        told = f"{error.strerror}: choose another" if isinstance(error, OSError) else error
        raise GatewayError(f"--to {to}: {told}") from error
    if outlet.place:
        typer.echo(outlet.place)
    if isinstance(outlet, FileOutlet):
        speed = float("inf")
    if any(fault.name == "unplug" for fault in plan.link_faults) and not hasattr(outlet, "unplug"):
        raise GatewayError(f"--to {to}: this cannot be unplugged, as the scenario wants: choose pty, tcp or slcan")
    if hasattr(outlet, "on_stall"):
        outlet.on_stall = lambda: typer.echo(f"{outlet.place} is full: waiting for a reader", err=True)
    threading.Thread(target=lambda: stop.wait() and outlet.close(), daemon=True).start()  # also while it waits
    try:
        with outlet:
            played = play(_telling(plugged(units(plan, carrier), plan), outlet), outlet, speed, stop)
    except OSError as error:  # from the system, or in words from what reads the terrain
        place = error.filename or f"--to {to}"
        told = f"{place}: {error.strerror}: choose another" if error.strerror else f"simulation: {error}"
        raise GatewayError(told) from error
    except ValueError as error:
        raise GatewayError(f"simulation: {error}") from error
    if stop.is_set():
        return
    sent = f"{played.units} {UNITS[carrier.name]}, {played.size_bytes} bytes"
    typer.echo(f"{sent}, at worst {played.worst_lateness_s * 1e3:.1f} ms late", err=True)


def _telling(units: Iterator[tuple[int, Any]], outlet: Any) -> Iterator[tuple[int, Any]]:
    """The same; says where the outlet is when it has been plugged in again, as the name may be another."""
    from simulators.faults.plug import Plug

    for ready_ns, unit in units:
        yield ready_ns, unit
        if unit is Plug.IN:
            typer.echo(outlet.place)
