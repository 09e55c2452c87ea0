"""What a recording says of itself: enough to replay it exactly, and to know what made it."""

import json
import platform
from importlib.metadata import version
from pathlib import Path

from pydantic import ValidationError

from gateway.config import RackConfig
from gateway.doctor.clock import host_clock
from gateway.errors import GatewayError
from gateway.names import shown
from monitor.calibration import Calibration, load_calibration
from monitor.integrity import Monitor
from monitor.terrain import open_terrain
from monitor.terrain_files import TerrainError
from monitor.water import open_water

COPY = "look for another copy, or update shadebus if a later version wrote it"
ANEW = f"judge it anew by a rack file with another one (shadebus reprocess -c), {COPY}"


def build_monitor(config: RackConfig, calibration: Calibration | None = None) -> Monitor | None:
    """The monitor that a configuration asks for, or None without terrain. Raises GatewayError naming the file."""
    try:
        if calibration is None and config.calibration:
            calibration = load_calibration(config.calibration)
        if not config.terrain and config.water:
            raise GatewayError("water without terrain masks nothing: name the terrain too, or leave the water out")
        if not config.terrain:
            return None
        terrain = open_terrain(config.terrain)
        large_km2 = config.monitor.minimum_water_km2
        water = open_water(config.water, terrain, large_km2) if config.water else None
        return Monitor(terrain, config.monitor, calibration, water)
    except UnicodeEncodeError:
        raise  # of a name, which the command line tells
    except (TerrainError, ValueError) as error:
        raise GatewayError(str(error)) from error


def describe(config: RackConfig, monitor: Monitor | None) -> dict[str, str]:
    """The metadata of a new recording. Raises GatewayError naming a path that is not UTF-8, as JSON has to be."""
    # not model_dump_json, which writes an infinite number as null and so could not read it back
    configuration = json.dumps(config.model_dump(mode="json"), ensure_ascii=False)
    try:
        configuration.encode()
    except UnicodeEncodeError as error:
        begin, end = configuration.rfind('"', 0, error.start) + 1, configuration.find('"', error.start)
        name = shown(configuration[begin:end])
        raise GatewayError(f"{name}: the name is not UTF-8, so no recording can hold it: rename it") from error
    return {
        "configuration": configuration,
        "calibration": monitor.calibration.model_dump_json() if monitor and monitor.calibration else "",
        "terrain_checksum": monitor.terrain.checksum if monitor else "",
        "water_checksum": monitor.water.checksum if monitor and monitor.water else "",
        "shadebus": version("shadebus"),
        "numpy": version("numpy"),
        "python": platform.python_version(),
        "host": platform.node(),
        "boot": _boot(),
        "clock": host_clock().seen,
    }


def _boot() -> str:
    """Which start of the host this is: within one, monotonic times can be compared."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


def recorded_config(metadata: dict[str, str], path: Path | str = "the recording") -> RackConfig:
    """The configuration that a recording was made with. Raises GatewayError naming `path` if it holds none of ours."""
    try:
        return RackConfig.model_validate_json(metadata["configuration"])
    except (KeyError, ValidationError) as error:
        raise GatewayError(f"{path} holds no configuration that this version understands: {COPY}") from error


def recorded_monitor(
    metadata: dict[str, str], config: RackConfig, terrain: tuple[Path, ...] = (), water: tuple[Path, ...] = ()
) -> Monitor | None:
    """The monitor that a recording was made with; `terrain` and `water` replace the files it was made with.

    Raises GatewayError if the recorded files are not there any more or have changed.
    """
    try:
        calibration = Calibration.model_validate_json(metadata["calibration"]) if metadata["calibration"] else None
    except (KeyError, ValidationError) as error:
        raise GatewayError(f"the recording holds no calibration that this version understands: {ANEW}") from error
    config = config.with_maps(terrain, water)
    monitor = build_monitor(config, calibration)
    if monitor and not terrain and monitor.terrain.checksum != metadata["terrain_checksum"]:
        files = ", ".join(str(path) for path in config.terrain)
        raise GatewayError(f"{files} changed since the recording was made: name the terrain to use with --dem")
    if monitor and monitor.water and not water and monitor.water.checksum != metadata.get("water_checksum"):
        files = ", ".join(str(path) for path in config.water)
        raise GatewayError(f"water {files} changed since the recording was made: name the water to use with --water")
    return monitor
