"""The configuration of a rack: one TOML file, checked as a whole before anything opens."""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from decoders.definitions import load_definitions
from decoders.profiles import load_profile
from gateway.errors import GatewayError
from monitor.settings import MonitorSettings


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _known_definitions(name: str) -> str:
    try:
        load_definitions(name)
    except OSError as error:
        raise ValueError(f"definitions {name} cannot be read: {error.strerror}") from error
    return name


def _known_profile(name: str) -> str:
    load_profile(name)
    return name


DefinitionsName = Annotated[str, AfterValidator(_known_definitions)]
ProfileName = Annotated[str, AfterValidator(_known_profile)]
ChannelNumber = Annotated[int, Field(ge=0, le=255)]  # one byte of a packet


def _octal(label: str) -> str:
    if not re.fullmatch("[0-3][0-7]{2}", label):
        raise ValueError(f"label {label!r} is not three octal digits, 000 to 377")
    return label


OctalLabel = Annotated[str, AfterValidator(_octal)]
Delay = Annotated[float, Field(ge=0, le=1000)]


class ChannelConfig(_Section):
    """What a channel of a bridge carries, where its hello packet does not say so or says too little."""

    kind: Literal["arinc429", "arinc708"]
    definitions: DefinitionsName | None = Field(None, description="label set by name, or a TOML file of one")
    orientation: Literal["wire", "label_swapped"] = "wire"
    profile: ProfileName | None = Field(None, description="ARINC 708 profile")
    join_rule: Literal["concatenate", "toward_zero"] = Field(
        "concatenate", description="how fine position words join coarse ones in the south and west"
    )
    delays_ms: dict[OctalLabel, Delay] = Field(
        default_factory=dict, description="by octal label, how long after it was true a value is sent"
    )


class AdapterConfig(_Section):
    """One bridge: its name in the recording and where it is."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    source: str = Field(
        pattern=r"^[a-z0-9]+:.+", description="serial:DEVICE, serial:socket://..., serial:rfc2217://..."
    )
    baud: int = Field(921_600, ge=300, le=12_000_000, description="bit/s of a serial line")
    channels: dict[ChannelNumber, ChannelConfig] = Field(default_factory=dict, description="by channel number")


class RecordingConfig(_Section):
    """Where recordings go, and how much a power cut may cost."""

    directory: Path = Path("recordings")
    sync_interval_s: float = Field(1.0, gt=0, le=60)
    queue_mib: int = Field(64, ge=1, le=4096, description="what adapters may hold back while the disk stalls")


class RackConfig(_Section):
    """Everything `shadebus run` needs."""

    adapters: tuple[AdapterConfig, ...]
    recording: RecordingConfig | None = None
    terrain: tuple[Path, ...] = Field((), description="GeoTIFF, HGT or DTED files")
    calibration: Path | None = Field(None, description="calibration file of the radar; stated defaults without")
    radar_profile: ProfileName = Field("arinc708", description="ARINC 708 profile of radar channels that name none")
    monitor: MonitorSettings = MonitorSettings()
    wait_for_devices: bool = Field(False, description="start although a device is not there yet, and keep trying")

    @model_validator(mode="after")
    def _adapters_have_names_of_their_own(self) -> Self:
        names = [adapter.name for adapter in self.adapters]
        if not names:
            raise ValueError("adapters: name at least one, as [[adapters]] with name and source")
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two adapters are named {name!r}: give each a name of its own")
        return self


def load_config(path: Path) -> RackConfig:
    """Read and check a rack file; relative paths in it count from where it lies.

    Raises GatewayError naming the file, the key and what it should be.
    """
    try:
        table = tomllib.loads(path.read_text())
    except OSError as error:
        raise GatewayError(f"cannot read configuration {path}: {error.strerror}") from error
    except ValueError as error:  # not TOML, or not even text
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
            f"{'.'.join(str(part) for part in problem['loc']) or 'the whole'}: {problem['msg']}"
            for problem in error.errors()
        ).replace("Value error, ", "")
        raise GatewayError(f"{origin}: {problems}") from error
