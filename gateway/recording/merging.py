"""Several recordings as one, by time: of one rack one after the other, or of racks that flew together.

The monotonic clocks of different hosts, or of one host started anew, are laid beside each other by the UTC of the first
records; within one start of a host they are compared as they are. Order inside each recording stays.
"""

import heapq
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gateway.config import AdapterConfig, RackConfig
from gateway.errors import GatewayError
from gateway.metadata import recorded_config
from gateway.names import shown
from gateway.recording.session import Recording
from gateway.recording.whole import write_whole
from gateway.records import Raw, Record, Stamp, Status

Until = Callable[[Iterable[Record]], Iterator[Record]]
OF_ONE_FILE = ("session", "file", "cut", "recovered")  # metadata that does not hold for the whole


@dataclass
class _Source:
    recording: Recording
    config: RackConfig
    first: Stamp
    last: Stamp
    shift_ns: int = 0  # of its monotonic clock, to the first one's
    renamed: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return shown(self.recording.path.name)

    def overlaps(self, other: "_Source") -> bool:
        return not (
            self.last.monotonic_ns + self.shift_ns < other.first.monotonic_ns + other.shift_ns
            or other.last.monotonic_ns + other.shift_ns < self.first.monotonic_ns + self.shift_ns
        )

    def records(self, until: Until) -> Iterator[Record]:
        """Its records with the common monotonic time and the new names."""
        for record in until(self.recording):
            stamp = Stamp(record.stamp.monotonic_ns + self.shift_ns, record.stamp.utc_ns)
            if isinstance(record, Raw | Status):
                yield record._replace(stamp=stamp, adapter=self.renamed.get(record.adapter, record.adapter))
            else:
                yield record._replace(stamp=stamp)


def merge(recordings: Sequence[Recording], out: Path, until: Until = iter) -> list[str]:
    """Write all records by time, numbered anew; what is worth telling, such as adapters renamed.

    `until` wraps what is iterated over, for whoever wants to end it early. Raises GatewayError as `write_whole` does,
    and if the configurations contradict each other.
    """
    sources = [_opened(recording, until) for recording in recordings]
    for source in sources:
        source.shift_ns = _shift_ns(source, sources[0])
    earliest_ns = min(source.first.monotonic_ns + source.shift_ns for source in sources)
    for source in sources:
        source.shift_ns -= min(earliest_ns, 0)  # of a host that was started before the first one
    adapters, told = _adapters(sources)
    told += [f"{source.name}: {shown(text)}" for source in sources for text in source.recording.complaints]
    metadata = _metadata(sources, adapters, told)
    streams = [source.records(until) for source in sources]
    merged = heapq.merge(*streams, key=lambda record: record.stamp.monotonic_ns)
    count = write_whole(out, metadata, (record._replace(sequence=k) for k, record in enumerate(merged)))
    return [f"{count} records", *told]


def _opened(recording: Recording, until: Until) -> _Source:
    first = last = None
    for record in until(recording):
        first, last = first or record.stamp, record.stamp
    if first is None or last is None:
        raise GatewayError(f"{recording.path} holds no records: leave it out")
    return _Source(recording, recorded_config(recording.metadata, recording.path), first, last)


def _shift_ns(source: _Source, reference: _Source) -> int:
    boots = [s.recording.metadata.get("boot", "") for s in (source, reference)]
    if source is reference or (boots[0] and boots[0] == boots[1]):
        return 0
    return (source.first.utc_ns - source.first.monotonic_ns) - (reference.first.utc_ns - reference.first.monotonic_ns)


def _adapters(sources: list[_Source]) -> tuple[dict[str, AdapterConfig], list[str]]:
    """All adapters. One name with one configuration at different times is one adapter; any other clash is renamed."""
    owners: dict[str, list[_Source]] = {}
    adapters: dict[str, AdapterConfig] = {}
    told: list[str] = []
    for place, source in enumerate(sources, start=1):
        for adapter in source.config.adapters:
            name = adapter.name
            same = adapters.get(name) == adapter and not any(source.overlaps(owner) for owner in owners[name])
            if name in adapters and not same:
                while name in adapters:
                    name = f"{name}-{place}"
                source.renamed[adapter.name] = name
                told.append(f"adapter {adapter.name} of {source.name} is {name} now: another one has its name")
            adapters[name] = adapter.model_copy(update={"name": name})
            owners.setdefault(name, []).append(source)
    return adapters, told


def _metadata(sources: list[_Source], adapters: dict[str, AdapterConfig], told: list[str]) -> dict[str, str]:
    """The metadata of the first, with what others alone have, and the configuration of all."""
    terrain = _only(sources, "terrain", lambda s: s.recording.metadata.get("terrain_checksum", ""), "")
    water = _only(sources, "water", lambda s: s.recording.metadata.get("water_checksum", ""), "")
    calibration = _only(sources, "calibration", lambda s: s.recording.metadata.get("calibration", ""), "")
    changes: dict[str, object] = {
        "terrain": terrain.config.terrain,
        "water": water.config.water,
        "calibration": calibration.config.calibration,
    }
    for key in ("radar_profile", "monitor"):
        default = RackConfig.model_fields[key].default
        changes[key] = getattr(_only(sources, key, _reading(key), default).config, key)
    config = sources[0].config.model_copy(update={**changes, "adapters": tuple(adapters.values())})
    return {
        **{key: text for key, text in sources[0].recording.metadata.items() if key not in OF_ONE_FILE},
        "configuration": json.dumps(config.model_dump(mode="json")),
        "terrain_checksum": terrain.recording.metadata.get("terrain_checksum", ""),
        "water_checksum": water.recording.metadata.get("water_checksum", ""),
        "calibration": calibration.recording.metadata.get("calibration", ""),
        "host": ", ".join(dict.fromkeys(s.recording.metadata.get("host", "") for s in sources)),
        "merged": "; ".join([", ".join(s.name for s in sources), *told]),
    }


def _reading(key: str) -> Callable[[_Source], object]:
    return lambda source: getattr(source.config, key)


def _only(sources: list[_Source], what: str, value: Callable[[_Source], object], none: object) -> _Source:
    """The first source that says something of a thing. Raises GatewayError if another says something else."""
    saying = [source for source in sources if value(source) != none]
    for other in saying[1:]:
        if value(other) != value(saying[0]):
            raise GatewayError(
                f"{saying[0].name} and {other.name} were recorded with a different {what}: one replay cannot have "
                "both; merge those that agree"
            )
    return saying[0] if saying else sources[0]
