"""The configuration of a rack: one TOML file, checked as a whole before anything opens."""

import math
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import ErrorDetails

from decoders import control708
from decoders.definitions import Definitions, load_definitions, parse_definitions
from decoders.profiles import Profile, load_profile, parse_profile
from gateway.errors import GatewayError
from monitor import gate
from monitor.settings import MonitorSettings

OUR_NAMES = ("core", "host", "journal", "radar", "recording")  # of what tells events beside the adapters


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def _from_home(path: Path) -> Path:
    try:
        return path.expanduser()
    except RuntimeError as error:
        raise ValueError(f"{path} begins in a home that there is not: write the whole path") from error


# Kinds that TOML has not: text stands for a path, a list for a tuple.
PathText = Annotated[Path, Field(strict=False), AfterValidator(_from_home)]
PathTexts = Annotated[tuple[PathText, ...], Field(strict=False)]


class TomlFile(_Section):
    """A file of the user's own, kept with its text: a recording replays without the file."""

    path: PathText
    text: str


def _kept(name: object, info: ValidationInfo) -> object:
    """A path to a TOML file becomes the file; it counts from the rack file, the context's `base`."""
    if not isinstance(name, str | dict | TomlFile):
        raise ValueError("write a name, or the path of a .toml file")  # noqa: TRY004 # which pydantic would not tell
    if not isinstance(name, str) or not name.endswith(".toml"):
        return name
    path = (info.context or {}).get("base", Path()) / _from_home(Path(name))
    try:
        return TomlFile(path=path, text=path.read_text("utf-8"))
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is no TOML: {error}") from error


def definitions_of(source: str | TomlFile) -> Definitions:
    """The label set that a channel names. Raises ValueError for an unknown name or a set that is refused."""
    definitions = load_definitions(source) if isinstance(source, str) else parse_definitions(source.text, source.path)
    control708.is_panel(definitions)  # which refuses one that cannot be compared
    gate.check_mode(definitions)
    return definitions


def profile_of(source: str | TomlFile) -> Profile:
    """The radar profile that a channel names. Raises ValueError for an unknown name or a profile that is refused."""
    return load_profile(source) if isinstance(source, str) else parse_profile(source.text, source.path)


def _checked(load: Callable[[str | TomlFile], object]) -> AfterValidator:
    def check(source: str | TomlFile) -> str | TomlFile:
        load(source)
        return source

    return AfterValidator(check)


Source = Annotated[str | TomlFile, BeforeValidator(_kept)]
DefinitionsSource = Annotated[Source, _checked(definitions_of)]
ProfileSource = Annotated[Source, _checked(profile_of)]


def _number(key: object) -> object:
    """Keys of tables are text; of several texts that may mean a number only one is taken, or two tables were one."""
    if isinstance(key, str):
        if not re.fullmatch("0|[1-9][0-9]{0,2}", key):
            raise ValueError(f"{key!r} is no channel: write plain digits, 0 to 255")
        return int(key)
    return key


ChannelNumber = Annotated[int, Field(ge=0, le=255), BeforeValidator(_number)]  # one byte of a packet


def _octal(label: str) -> str:
    if not re.fullmatch("[0-3][0-7]{2}", label):
        raise ValueError(f"label {label!r} is not three octal digits, 000 to 377")
    return label


OctalLabel = Annotated[str, AfterValidator(_octal)]
Delay = Annotated[float, Field(ge=0, le=1000)]


class ChannelConfig(_Section):
    """What a channel of a bridge carries, where its hello packet does not say so or says too little."""

    kind: Literal["arinc429", "arinc708"]
    definitions: DefinitionsSource | None = Field(None, description="label set by name, or a TOML file of one")
    orientation: Literal["wire", "label_swapped"] = "wire"
    profile: ProfileSource | None = Field(None, description="ARINC 708 profile by name, or a TOML file of one")
    join_rule: Literal["concatenate", "toward_zero"] = Field(
        "concatenate", description="how fine position words join coarse ones in the south and west"
    )
    sdi: int | None = Field(
        None, ge=1, le=3, description="the source to use where a bus carries several; words to all, SDI 0, count too"
    )
    delays_ms: dict[OctalLabel, Delay] = Field(
        default_factory=dict, description="by octal label, how long after it was true a value is sent"
    )


IDLE = {  # by kind, the options that nothing asks for
    "arinc429": {"profile"},
    "arinc708": {"definitions", "orientation", "join_rule", "sdi", "delays_ms"},
}


def _not_ours(name: str) -> str:
    if name in OUR_NAMES:
        raise ValueError(f"{name!r} is what the gateway calls a part of itself: choose another name")
    return name


FlagName = Literal["parity", "coding", "word_length", "sync"]  # as RackLink has them
Mask = Annotated[int, Field(ge=0, le=0xFFFF_FFFF)]


def _whole(size: object) -> object:
    if isinstance(size, bool | float):  # a Literal takes whatever equals a choice of its, as true does 1
        raise ValueError("write 1, 8 or 16")  # noqa: TRY004 # which pydantic would not tell
    return size


SizeBits = Annotated[Literal[1, 8, 16], BeforeValidator(_whole)]


class VendorConfig(_Section):
    """What a file of an interface card leaves open; where nothing is said, the layout's usual value is taken."""

    tick_ns: int | None = Field(None, ge=1, le=1_000_000_000, description="of the card's clock")
    flags_429: dict[FlagName, Mask] | None = Field(None, description="the card's bits that mean it, by our flag")
    flags_708: dict[FlagName, Mask] | None = Field(None, description="the same of radar words")
    size_bits: SizeBits | None = Field(None, description="what MXF's dataSize counts: bits, bytes or words")
    words_per_s: float | None = Field(None, ge=1, le=1e6, description="of an RDR-4B's file, which has no times")


class AdapterConfig(_Section):
    """One bridge: its name in the recording and where it is."""

    name: Annotated[str, AfterValidator(_not_ours)] = Field(pattern=r"^[A-Za-z0-9_-]+$")
    source: str = Field(
        pattern=r"^[a-z0-9]+:.+",
        description="serial:DEVICE, serial:socket://..., serial:rfc2217://..., usb:VID:PID:SERIAL, "
        "can:INTERFACE:CHANNEL, udp:HOST:PORT; file:NAME of what was imported",
    )
    framing: Literal["racklink", "bare708", "candump", "seqrecord", "mxf429", "mxf708", "rdr4b"] = Field(
        "racklink",
        description="bare708 for a UDP sender whose datagrams are radar words and nothing else; "
        "candump and the rest for files that were imported",
    )
    baud: int = Field(921_600, ge=300, le=12_000_000, description="bit/s of a serial line")
    channels: dict[ChannelNumber, ChannelConfig] = Field(default_factory=dict, description="by channel number")
    vendor: VendorConfig = VendorConfig()

    @model_validator(mode="after")
    def _the_source_can_have_the_framing(self) -> Self:
        kind = self.source.partition(":")[0]
        if self.framing == "bare708" and kind != "udp":
            raise ValueError('framing "bare708" is for udp sources: leave it out')
        if kind == "file" and self.framing in ("racklink", "bare708"):
            raise ValueError("file: is what `shadebus import` has read: name a device, or set the file's framing")
        if kind != "file" and self.framing not in ("racklink", "bare708"):
            raise ValueError(f"framing {self.framing!r} is for files that are imported: leave it out")
        return self


class RecordingConfig(_Section):
    """Where recordings go, and how much a power cut may cost."""

    directory: PathText = Path("recordings")
    sync_interval_s: float = Field(1.0, gt=0, le=60)
    rotate_mib: float = Field(1024, ge=0, le=1 << 20, description="a new file from this size on; 0 for one of any size")
    rotate_minutes: float = Field(60, ge=0, le=10_000, description="a new file after so long; 0 for one of any length")
    reserve_mib: float = Field(256, ge=0, le=1 << 20, description="room that is left to others: recording stops before")
    queue_mib: int = Field(64, ge=1, le=4096, description="what adapters may hold back while the disk stalls")


class RackConfig(_Section):
    """Everything `shadebus run` needs."""

    adapters: Annotated[tuple[AdapterConfig, ...], Field(strict=False)] = ()
    recording: RecordingConfig | None = None
    terrain: PathTexts = Field((), description="GeoTIFF, HGT or DTED files")
    water: PathTexts = Field(
        (),
        description="rasters, where every value but 0 is water, or GeoJSON polygons: over large water nothing counts",
    )
    calibration: PathText | None = Field(None, description="calibration file of the radar; stated defaults without")
    radar_profile: ProfileSource = Field("arinc708", description="ARINC 708 profile of radar channels that name none")
    monitor: MonitorSettings = MonitorSettings()
    wait_for_devices: bool = Field(False, description="start although a device is not there yet, and keep trying")

    def with_maps(self, terrain: tuple[Path, ...], water: tuple[Path, ...]) -> Self:
        """The same with other terrain and water, of each only if files are given."""
        return self.model_copy(update={"terrain": terrain or self.terrain, "water": water or self.water})

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
    base = path.absolute().parent
    config = check_config(table, str(path), base)
    _check_idle(config, path)
    recording = config.recording and config.recording.model_copy(
        update={"directory": base / config.recording.directory}
    )
    changes = {
        "terrain": tuple(base / file for file in config.terrain),
        "water": tuple(base / file for file in config.water),
        "calibration": config.calibration and base / config.calibration,
        "recording": recording,
    }
    return config.model_copy(update=changes)


def _check_idle(config: RackConfig, path: Path) -> None:
    """Here and not in the model, since recordings of older versions may hold such options."""
    idle = [
        f"adapters.{k}.channels.{number}.{name}: {channel.kind} has no use for it: leave it out"
        for k, adapter in enumerate(config.adapters)
        for number, channel in adapter.channels.items()
        for name in sorted(channel.model_fields_set & IDLE[channel.kind])
    ]
    if idle:
        raise GatewayError(f"{path}: {'; '.join(idle)}")


def check_config(table: dict[str, object], origin: str, base: Path = Path()) -> RackConfig:
    """A rack configuration from its table, its TOML files read from `base`, other paths as they stand.

    Raises GatewayError naming origin and key.
    """
    try:
        return RackConfig.model_validate(table, context={"base": base})
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(str(part) for part in problem['loc']) or 'the whole'}: {_said(problem)}"
            for problem in error.errors()
        )
        raise GatewayError(f"{origin}: {problems}") from error


# In words for whoever wrote the file, where pydantic has Python's.
SAID = {
    "extra_forbidden": "there is no such option: see docs/options.md for [monitor], examples/rack.toml for the rest",
    "tuple_type": "write a list, in brackets",
    "path_type": "write a path, in quotes",
    "model_type": "write a table of options",
    "dict_type": "write a table",
}


def _said(problem: ErrorDetails) -> str:
    """What is wrong with a value."""
    if isinstance(problem["input"], float) and math.isnan(problem["input"]):
        return "it is no number"
    return SAID.get(problem["type"], problem["msg"].removeprefix("Value error, "))
