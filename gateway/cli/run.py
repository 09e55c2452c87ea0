"""`shadebus run`: the service."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer


def run(
    config: Annotated[Path | None, typer.Option("-c", "--config", help="rack file (TOML)")] = None,
    source: Annotated[list[str] | None, typer.Option(help="KIND:ADDRESS without a rack file; repeatable")] = None,
    dem: Annotated[list[Path] | None, typer.Option(help="terrain file; repeatable")] = None,
    water: Annotated[list[Path] | None, typer.Option(help="water file; repeatable")] = None,
    record: Annotated[Path | None, typer.Option(help="directory for the recording")] = None,
    calibration: Annotated[Path | None, typer.Option(help="calibration file of the radar")] = None,
    json: Annotated[bool, typer.Option("--json", help="events as JSON lines")] = False,
    seconds: Annotated[float | None, typer.Option("--for", min=0, help="stop after so many seconds")] = None,
    wait: Annotated[bool, typer.Option("--wait", help="start although a device is not there yet")] = False,
) -> None:
    """Listen to the buses, record every byte, and judge the terrain live; Ctrl-C or SIGTERM ends it in good order."""
    from gateway.stopping import Stop

    stop = Stop(patience_s=None)  # what was read is written down first
    from gateway.config import RackConfig, check_config, load_config
    from gateway.console import print_json, print_line
    from gateway.errors import GatewayError
    from gateway.metadata import build_monitor
    from gateway.service import Service
    from gateway.warmup import COMPILING, compiled

    if bool(config) == bool(source):
        raise GatewayError("name either a rack file with -c or at least one --source, such as serial:/dev/ttyUSB0")
    rack: RackConfig
    if config:
        rack = load_config(config)
    else:
        adapters = [{"name": f"bridge{k}", "source": text} for k, text in enumerate(source or [])]
        rack = check_config({"adapters": adapters}, "--source")
    maps = {"terrain": dem, "water": water}
    changes: dict[str, object] = {name: [path.absolute() for path in files] for name, files in maps.items() if files}
    if record:
        changes["recording"] = {
            **(rack.recording.model_dump() if rack.recording else {}),
            "directory": record.absolute(),
        }
    if calibration:
        changes["calibration"] = calibration.absolute()
    if wait:
        changes["wait_for_devices"] = True
    rack = check_config({**rack.model_dump(), **changes}, "options")

    service = Service(rack, build_monitor(rack), print_json if json else print_line)
    if not rack.terrain:
        print("no terrain given: scans and state only, no verdicts", file=sys.stderr)
    if service.recording_path:
        print(f"recording to {service.recording_path}", file=sys.stderr)
    if not compiled():
        print(f"{COMPILING}; what comes is recorded, and judged then", file=sys.stderr)
    service.run_until(stop, seconds)
    if service.stuck:  # it holds stdout, so an orderly exit would wait for it too
        print(f"shadebus: {'; '.join(service.failures)}", file=sys.stderr, flush=True)
        os._exit(1)
    if service.deserted:
        raise service.deserted
    if service.failures:
        raise GatewayError("; ".join(service.failures))
