"""The configuration of a rack: one TOML file, checked as a whole before anything opens."""

import tomllib
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.errors import GatewayError
from monitor.settings import MonitorSettings


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ChannelConfig(_Section):
    """What a channel of a bridge carries, where its hello packet does not say so or says too little."""

    kind: Literal["arinc429", "arinc708"]
    definitions: str | None = Field(None, description="label set by name, or a TOML file of one")
    orientation: Literal["wire", "label_swapped"] = "wire"
    profile: str | None = Field(None, description="ARINC 708 profile")


class AdapterConfig(_Section):
    """One bridge: its name in the recording and where it is."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    source: str = Field(pattern=r"^serial:.+", description="serial:DEVICE, serial:socket://..., serial:rfc2217://...")
    baud: int = Field(921_600, ge=300, le=12_000_000, description="bit/s of a serial line")
    channels: dict[int, ChannelConfig] = Field(default_factory=dict, description="by channel number")


class RecordingConfig(_Section):
    """Where recordings go, and how much a power cut may cost."""

    directory: Path = Path("recordings")
    sync_interval_s: float = Field(1.0, gt=0, le=60)
    queue_mib: int = Field(64, ge=1, le=4096, description="what adapters may hold back while the disk stalls")


class RackConfig(_Section):
    """Everything `shadebus run` needs."""

    adapters: tuple[AdapterConfig, ...] = Field(min_length=1)
    recording: RecordingConfig | None = None
    terrain: tuple[Path, ...] = Field((), description="GeoTIFF, HGT or DTED files")
    calibration: Path | None = Field(None, description="made by `shadebus calibrate`; stated defaults without")
    radar_profile: str = Field("arinc708", description="ARINC 708 profile of radar channels that name none")
    monitor: MonitorSettings = MonitorSettings()
    wait_for_devices: bool = Field(False, description="start although a device is not there yet, and keep trying")


def load_config(path: Path) -> RackConfig:
    """Read and check a rack file; relative paths in it count from where it lies.

    Raises GatewayError naming the file, the key and what it should be.
    """
    try:
        table = tomllib.loads(path.read_text())
    except OSError as error:
        raise GatewayError(f"cannot read configuration {path}: {error.strerror}") from error
    except tomllib.TOMLDecodeError as error:
        raise GatewayError(f"configuration {path} is not TOML: {error}") from error
    config = check_config(table, str(path))
    base = path.absolute().parent
    recording = config.recording and config.recording.model_copy(
        update={"directory": base / config.recording.directory}
    )
    changes = {
        "terrain": tuple(base / file for file in config.terrain),
        "calibration": config.calibration and base / config.calibration,
        "recording": recording,
    }
    return config.model_copy(update=changes)


def check_config(table: dict[str, object], origin: str) -> RackConfig:
    """A rack configuration from its table, with paths as they stand. Raises GatewayError naming origin and key."""
    try:
        return RackConfig.model_validate(table)
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(str(part) for part in problem['loc']) or 'the file'}: {problem['msg']}"
            for problem in error.errors()
        )
        raise GatewayError(f"{origin}: {problems}") from error
