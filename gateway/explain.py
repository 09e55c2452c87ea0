"""One bus word as rows of a table: field, bits, code, meaning."""

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429, arinc708
from decoders import formats as f
from decoders.definitions import Definition, DefinitionError, Definitions, load_definitions, set_names
from gateway.errors import GatewayError

Row = tuple[str, str, str, str]

SET_HEADINGS = ("set", "equipment", "labels")
LABEL_HEADINGS = (
    "label", "name", "encoding", "bits", "range", "LSB", "units", "positive", "interval (ms)", "confidence", "source",
)  # fmt: skip


def explain_429(text: str, definitions_name: str, orientation: str) -> list[Row]:
    """Rows for one ARINC 429 word in hexadecimal."""
    word = int.from_bytes(_bytes(text.removeprefix("0x").zfill(8), (4,)), "big")
    if orientation not in f.ORIENTATIONS:
        raise GatewayError(f"orientation {orientation!r}: use one of {', '.join(f.ORIENTATIONS)}")
    definitions = _definitions(definitions_name)
    block = np.array([word], np.uint32)
    parts = arinc429.unpack(block, orientation)
    values = arinc429.decode(block, definitions, orientation)
    label, ssm = int(parts.label[0]), int(parts.ssm[0])
    definition = definitions.labels.get(label)
    status = arinc429.Status(int(values.status[0]))
    name = definition.name if definition else f"not in {definitions.name}"
    meaning = f.SSM_TABLES[definition.ssm][ssm] if definition else "depends on the label"
    rows = [
        ("label", "1-8", f"{label:03o}", name),
        ("SDI", "9-10", f"{int(parts.sdi[0]):02b}", "data" if definition and not definition.has_sdi else "source"),
        ("data", "11-29", f"{int(parts.data[0]):019b}", f"0x{int(parts.data[0]):05x}"),
        ("SSM", "30-31", f"{ssm:02b}", meaning),
        ("parity", "32", f"{word >> 31}", "odd, good" if parts.parity_ok[0] else "BAD: the word is damaged"),
    ]
    if definition is None:
        return [*rows, ("value", "", "none", status.name)]
    for field_name, (first, last) in definition.fields.items():
        code = int(arinc429.field(block, definition, field_name)[0])
        rows.append((field_name, _span(first, last), f"{code:0{last - first + 1}b}", str(code)))
    first, last = definition.bits
    sense = f", positive is {definition.positive}" if definition.positive else ""
    value = _value(values, block, definition)
    return [*rows, ("value", _span(first, last + (definition.encoding == "bnr")), value, status.name + sense)]


def _value(values: arinc429.Values429, block: NDArray[np.uint32], definition: Definition) -> str:
    if values.status[0] != arinc429.Status.NORMAL:
        return "none"
    if definition.encoding == "iso5":
        return repr(arinc429.text(block, definition)[0])
    return f"{values.value[0]:.12g} {definition.units}".strip()


def _span(first: int, last: int) -> str:
    return f"{first}" if first == last else f"{first}-{last}"


def set_rows() -> list[tuple[str, ...]]:
    """Rows under `SET_HEADINGS`."""
    sets = [load_definitions(name) for name in set_names()]
    return [(one.name, f"{one.equipment_id:03X}", str(len(one.labels))) for one in sets]


def label_rows(definitions_name: str) -> list[tuple[str, ...]]:
    """Rows under `LABEL_HEADINGS` for a set. Raises GatewayError for one that there is not."""
    return [_label_row(row) for _, row in sorted(_definitions(definitions_name).labels.items())]


def _label_row(row: Definition) -> tuple[str, ...]:
    first, last = row.bits
    shortest, longest = row.interval_ms or (None, None)
    interval = "" if shortest is None else f"{shortest:g} to {longest:g}" if longest else f"{shortest:g} or more"
    fields = "".join(f", {name} {_span(*bits)}" for name, bits in row.fields.items())
    return (
        f"{row.label:03o}",
        row.name,
        row.encoding,
        _span(first, last + (row.encoding == "bnr")) + fields,
        "" if row.range is None else f"{float(row.range):.12g}",
        "" if row.encoding in ("disc", "iso5") else f"{float(row.lsb):.9g}",
        row.units,
        row.positive,
        interval,
        row.confidence,
        row.source,
    )


def _definitions(name: str) -> Definitions:
    try:
        return load_definitions(name)
    except (DefinitionError, ValueError, OSError) as error:
        raise GatewayError(str(error)) from error


def explain_708(text: str, profile_name: str) -> list[Row]:
    """Rows for one ARINC 708 word in hexadecimal; the header alone is enough."""
    data = _bytes(text, (f.HEADER_708_BYTES, f.WORD_708_BYTES))
    try:
        profile = arinc708.load_profile(profile_name)
    except ValueError as error:
        raise GatewayError(str(error)) from error
    whole = np.frombuffer(data.ljust(f.WORD_708_BYTES, b"\0"), np.uint8)[np.newaxis]
    radial = arinc708.unpack(whole, profile)
    bits = int.from_bytes(data[: f.HEADER_708_BYTES], "little")
    gain = float(radial.gain_db[0])
    meanings = {
        "label": f"{int(radial.label[0]):03o} octal",
        "control_accept": ("none", "indicator 1", "indicator 2", "both indicators")[int(radial.control_accept[0])],
        "slave": "slave" if radial.slave[0] else "master",
        "annunciations": _names(f.ANNUNCIATIONS_708, int(radial.annunciations[0])),
        "faults": _names(profile.faults, int(radial.faults[0])),
        "stabilised": "on" if radial.stabilised[0] else "off",
        "mode": profile.modes[int(radial.mode[0])],
        "tilt": f"{radial.tilt_deg[0]:+.2f} deg",
        "gain": "calibrated" if np.isnan(gain) else ("maximum" if gain == 0 else f"{gain:g} dB"),
        "range": f"{radial.range_nm[0]:g} NM",
        "data_accept": ("none", "1", "2", "any")[int(radial.data_accept[0])],
        "scan_angle": f"{radial.scan_angle_deg[0]:+.3f} deg from the {profile.scan_angle_zero}",
    }
    rows = [
        (name, f"{first}-{first + width - 1}", f"{bits >> first & (1 << width) - 1:0{width}b}", meanings[name])
        for name, (first, width) in f.HEADER_708.items()
    ]
    if len(data) == f.WORD_708_BYTES:
        levels = np.bincount(radial.bins[0])
        counts = ", ".join(f"level {level}: {count}" for level, count in enumerate(levels.tolist()) if count)
        rows.append(("bins", f"64-{f.WORD_708_BITS - 1}", f"{profile.bins} x {profile.bits_per_bin}", counts))
    return rows


def _names(names: tuple[str, ...], code: int) -> str:
    return ", ".join(name for k, name in enumerate(names) if code >> k & 1) or "none"


def _bytes(text: str, lengths: tuple[int, ...]) -> bytes:
    try:
        data = bytes.fromhex(text.removeprefix("0x"))
    except ValueError as error:
        raise GatewayError(f"{text!r} is not hexadecimal") from error
    if len(data) not in lengths:
        raise GatewayError(f"{len(data)} bytes given, {' or '.join(str(n) for n in lengths)} needed")
    return data
