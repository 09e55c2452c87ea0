"""`shadebus simulate`: a simulated flight as byte-exact bus traffic, or a recording transmitted once more."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

PLACES = "pty, tcp:PORT (0 takes a free one), file:PATH, udp:HOST:PORT, slcan or can:INTERFACE:CHANNEL"
UNITS = {"stream": "packets", "datagram": "datagrams", "can": "frames", "slcan": "lines"}
Units = Iterator[tuple[int, Any]]  # when each is ready, in ns, and what goes down the line


def simulate(
    scenario: Annotated[Path | None, typer.Argument(help="scenario (TOML); the White Mountains flight if left")] = None,
    to: Annotated[
        str,
        typer.Option(help=PLACES),
    ] = "pty",
    speed: Annotated[float, typer.Option(min=0.01, help="times real time; a file is written at once")] = 1.0,
    seed: Annotated[int | None, typer.Option(min=0, help="instead of the scenario's")] = None,
    duration: Annotated[float | None, typer.Option(min=1, help="seconds of the first leg, instead of its own")] = None,
    recording: Annotated[Path | None, typer.Option("--from", help="transmit this recording instead")] = None,
    adapter: Annotated[str | None, typer.Option(help="of the recording, where it has several")] = None,
) -> None:
    """Send the traffic of a bridge with a weather radar, an IRU, a GNSS receiver and a radio altimeter.

    With --from, what an adapter of a recording received goes out again, at the times of its chunks.
    Ctrl-C or SIGTERM ends it in good order.
    """
    from gateway.stopping import Stop

    stop = Stop()  # before the imports that take their time
    from gateway.errors import GatewayError

    if recording:
        if scenario or seed is not None or duration is not None:
            raise GatewayError("--from: a recording has no scenario, --seed or --duration: leave them out")
        _transmit(recording, adapter, to, speed, stop)
    elif adapter:
        raise GatewayError("--adapter is of a recording: name it with --from")
    else:
        _fly(_plan(scenario, seed, duration), to, speed, stop)


def _plan(path: Path | None, seed: int | None, duration: float | None) -> Any:
    """The scenario with what is said instead of it."""
    from gateway.errors import GatewayError
    from simulators.scenario import load, white_mountains

    try:
        plan = load(path) if path else white_mountains()
    except (OSError, ValueError) as error:
        raise GatewayError(str(error)) from error
    if duration is not None:
        plan = plan.model_copy(update={"flight": plan.flight.model_copy(update={"duration_s": duration})})
    if seed is not None:
        plan = plan.model_copy(update={"seed": seed})
    return plan


def _fly(plan: Any, to: str, speed: float, stop: threading.Event) -> None:
    from gateway.errors import GatewayError
    from simulators.faults.plug import plugged
    from simulators.link import units

    outlet, carrier = _opened(to)
    if any(fault.name == "unplug" for fault in plan.link_faults) and not hasattr(outlet, "unplug"):
        raise GatewayError(f"--to {to}: this cannot be unplugged, as the scenario wants: choose pty, tcp or slcan")
    _play(_telling(plugged(units(plan, carrier), plan), outlet), outlet, to, speed, stop, UNITS[carrier.name])


def _transmit(path: Path, adapter: str | None, to: str, speed: float, stop: threading.Event) -> None:
    from gateway.metadata import recorded_config
    from gateway.recording import Recording
    from gateway.retransmission import Sent, carrier_of, chosen

    source = Recording(path)
    config = chosen(recorded_config(source.metadata, path), adapter)
    sent, carried = Sent(source, config), carrier_of(config)
    outlet, carrier = _opened(to)
    if carried == carrier.name or (carried, carrier.name) == ("can", "slcan"):
        units = _as_recorded(sent, to, carrier.name)
    else:
        typer.echo(f"packets of {config.source} go out again as {UNITS[carrier.name]} of their own", err=True)
        units = _converted(sent, carrier)
    pieces = "pieces" if carrier.name == carried in ("stream", "slcan") else UNITS[carrier.name]
    _play(units, outlet, to, speed, stop, pieces)
    for what, count in sent.left_out.items():
        typer.echo(f"left out: {count} {what}", err=True)
    for text in source.complaints:
        typer.echo(f"shadebus: {path}: {text}", err=True)


def _as_recorded(sent: Any, to: str, carrier: str) -> Units:
    """What was received, as it was; frames as lines where the outlet is a line."""
    from gateway.errors import GatewayError
    from simulators.carriers import Frame, slcan_line

    for time_ns, unit in sent.units():
        if isinstance(unit, bytes):
            yield time_ns, unit
            continue
        frame = Frame(*unit)
        if carrier == "slcan":
            yield time_ns, slcan_line(frame)
            continue
        if frame.fd and not to.endswith("?fd=true"):
            raise GatewayError(f"--to {to}: the recording has frames of CAN FD: write {to}?fd=true")
        yield time_ns, frame


def _converted(sent: Any, carrier: Any) -> Units:
    """The packets that were received, made into units of another kind of line. What has no form there is left out."""
    import struct

    from decoders.formats import WORDS_429
    from gateway.link import SPOILT
    from simulators.racklink import Packet

    for time_ns, received in sent.packets():
        packet = Packet(*received)
        try:
            units = carrier.units(packet)
        except (ValueError, struct.error):
            units = []
        spoilt = carrier.name in ("can", "slcan") and packet.words and packet.flags & SPOILT
        if not units or (spoilt and packet.type == WORDS_429):
            sent.left_out["packets that such a line has no form for"] += 1
            continue
        for unit in units:
            yield time_ns, unit


def _opened(to: str) -> Any:
    """The outlet and how packets are carried to it; its name is printed for whoever is to listen."""
    from gateway.errors import GatewayError
    from simulators.outlets.named import named

    try:
        way = named(to)
    except (OSError, ValueError) as error:
        told = f"{error.strerror}: choose another" if isinstance(error, OSError) else error
        raise GatewayError(f"--to {to}: {told}") from error
    if way.outlet.place:
        typer.echo(way.outlet.place)
    return way


def _play(units: Units, outlet: Any, to: str, speed: float, stop: threading.Event, name: str) -> None:
    """Play everything, and say how it went."""
    from gateway.errors import GatewayError
    from simulators.outlets import FileOutlet
    from simulators.player import play

    if isinstance(outlet, FileOutlet):
        speed = float("inf")
    if hasattr(outlet, "on_stall"):
        outlet.on_stall = lambda: typer.echo(f"{outlet.place} is full: waiting for a reader", err=True)
    threading.Thread(target=lambda: stop.wait() and outlet.close(), daemon=True).start()  # also while it waits
    try:
        with outlet:
            played = play(units, outlet, speed, stop)
    except OSError as error:  # from the system, or in words from what reads the terrain
        place = error.filename or f"--to {to}"
        told = f"{place}: {error.strerror}: choose another" if error.strerror else f"simulation: {error}"
        raise GatewayError(told) from error
    except ValueError as error:
        raise GatewayError(f"simulation: {error}") from error
    if not stop.is_set():
        sent = f"{played.units} {name}, {played.size_bytes} bytes"
        typer.echo(f"{sent}, at worst {played.worst_lateness_s * 1e3:.1f} ms late", err=True)


def _telling(units: Units, outlet: Any) -> Units:
    """The same; says where the outlet is when it has been plugged in again, as the name may be another."""
    from simulators.faults.plug import Plug

    for ready_ns, unit in units:
        yield ready_ns, unit
        if unit is Plug.IN:
            typer.echo(outlet.place)
