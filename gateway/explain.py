"""One bus word as rows of a table: field, bits, code, meaning."""

import string
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decoders import arinc429, arinc708
from decoders import formats as f
from decoders.definitions import Definition, Definitions, load_definitions, set_names
from gateway.errors import GatewayError

Row = tuple[str, ...]  # field, bits, code, meaning; of a 708 word field, bits, code, value, unit, note

SIGNS = {0b00: "plus", f.SSM_BCD_MINUS: "minus"}
SHOWN = 40  # characters of a wrong word
SET_HEADINGS = ("set", "equipment", "labels")
LABEL_HEADINGS = (
    "label", "name", "encoding", "bits", "range", "LSB", "units", "positive", "interval (ms)", "confidence", "source",
)  # fmt: skip


def explain_429(text: str, definitions_name: str, orientation: str) -> list[Row]:
    """Rows for one ARINC 429 word in hexadecimal."""
    word = int.from_bytes(_bytes(text, (4,)), "big")
    if orientation not in f.ORIENTATIONS:
        raise GatewayError(f"orientation {orientation!r}: use one of {', '.join(f.ORIENTATIONS)}")
    definitions = _definitions(definitions_name)
    block = np.array([word], np.uint32)
    parts = arinc429.unpack(block, orientation)
    values = arinc429.decode(block, definitions, orientation)
    label, sdi, ssm = int(parts.label[0]), int(parts.sdi[0]), int(parts.ssm[0])
    definition = definitions.labels.get(label)
    status = arinc429.Status(int(values.status[0]))
    name = definition.name if definition else f"not in {definitions.name}"
    source, meaning = _meanings(ssm, definition) if definition else ("depends on the label", "depends on the label")
    rows: list[Row] = [
        ("label", "1-8", f"{label:03o}", name),
        ("SDI", "9-10", f"{sdi:02b}", source),
        ("data", "11-29", f"{int(parts.data[0]):019b}", f"0x{int(parts.data[0]):05x}"),
        ("SSM", "30-31", f"{ssm:02b}", meaning),
        ("parity", "32", f"{word >> 31}", "odd, good" if parts.parity_ok[0] else "BAD: the word is damaged"),
    ]
    if definition is None:
        return [*rows, ("value", "", "none", status.name)]
    for field_name, (first, last) in definition.fields.items():
        code = int(arinc429.field(block, definition, field_name)[0])
        said = "not to be trusted" if status is arinc429.Status.BAD_PARITY else str(code)
        rows.append((field_name, _span(first, last), f"{code:0{last - first + 1}b}", said))
    first, last = definition.bits
    sense = f", positive is {definition.positive}" if definition.positive else ""
    value = _value(values, block, definition)
    return [*rows, ("value", _span(first, last + (definition.encoding == "bnr")), value, status.name + sense)]


def _meanings(ssm: int, definition: Definition) -> tuple[str, str]:
    """What bits 9-10 are, and what the SSM says; that of a decimal value is its sign too."""
    meaning = f.SSM_TABLES[definition.ssm][ssm]
    if definition.encoding == definition.ssm == "bcd" and ssm in SIGNS:
        meaning = f"{meaning}, {SIGNS[ssm]}"
    return "source" if definition.has_sdi else "data", meaning


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
    except OSError as error:
        raise GatewayError(f"{name} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise GatewayError(str(error)) from error


def explain_708(text: str, profile_name: str) -> list[Row]:
    """Rows for one ARINC 708 word in hexadecimal; the header alone is enough, and bins need the whole word."""
    data = _bytes(text, range(f.HEADER_708_BYTES, f.LONGEST_WORD_708_BITS // 8 + 2))
    try:
        profile = arinc708.load_profile(profile_name)
    except OSError as error:
        raise GatewayError(f"{profile_name} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise GatewayError(str(error)) from error
    word = np.frombuffer(data, np.uint8)[np.newaxis]
    header = arinc708.headers(word, profile)
    bits = int.from_bytes(data[: f.HEADER_708_BYTES], "little")
    places = sorted((f.HEADER_708 | f.SPARE_708).items(), key=lambda item: item[1])
    codes = {name: bits >> first & (1 << width) - 1 for name, (first, width) in places}
    codes["label"] = int(header.label[0])  # the one field sent most significant bit first
    said = _values(header, codes, profile)
    rows: list[Row] = [
        (
            name,
            _span(first, first + width - 1),
            f"{codes[name]:0{width}b}",
            *said[name],
            _note(name, codes[name], profile),
        )
        for name, (first, width) in places
    ]
    start = 8 * f.HEADER_708_BYTES
    payload = _span(start, start + profile.bins * profile.bits_per_bin - 1)
    if len(data) != profile.word_bytes:
        return [*rows, ("bins", payload, "", "", "", f"not shown: {len(data)} bytes, of {profile.word_bytes}")]
    return rows + _bins(arinc708.unpack(word, profile), payload, profile)


def _values(header: arinc708.Header, codes: dict[str, int], profile: arinc708.Profile) -> dict[str, tuple[str, str]]:
    """The value of each header field, and its unit."""
    gain = float(header.gain_db[0])
    return dict.fromkeys(f.SPARE_708, ("", "")) | {
        "label": (f"{codes['label']:03o}", "octal"),
        "control_accept": (("none", "indicator 1", "indicator 2", "both indicators")[codes["control_accept"]], ""),
        "slave": ("slave" if codes["slave"] else "master", ""),
        "annunciations": (_names(f.ANNUNCIATIONS_708, codes["annunciations"]), ""),
        "faults": (_names(profile.faults, codes["faults"]), ""),
        "stabilised": ("on" if codes["stabilised"] else "off", ""),
        "mode": (profile.modes[codes["mode"]], ""),
        "tilt": (f"{header.tilt_deg[0]:+.2f}", "deg"),
        "gain": ("calibrated", "") if np.isnan(gain) else (f"{gain:g}", "dB"),
        "range": (f"{header.range_nm[0]:g}", "NM"),
        "data_accept": (("none", "1", "2", "any")[codes["data_accept"]], ""),
        "scan_angle": (f"{header.scan_angle_deg[0]:+.3f}", "deg"),
    }


def _note(name: str, code: int, profile: arinc708.Profile) -> str:
    if name in f.SPARE_708:
        return "UNUSUAL: a spare bit is set" if code else ""
    if name == "label" and code not in profile.labels:
        return f"UNUSUAL: {profile.name} has {', '.join(f'{label:03o}' for label in profile.labels)}"
    if name == "mode" and profile.modes[code] == arinc708.RESERVED:
        return "UNUSUAL: a reserved code"
    if name == "scan_angle":
        given, sent = "clockwise from the nose", f"{profile.scan_angle_sense} from the {profile.scan_angle_zero}"
        return given if sent == given else f"{given}; sent {sent}"
    return "maximum" if name == "gain" and code == 0 else ""


def _bins(radials: arinc708.Radials, payload: str, profile: arinc708.Profile) -> list[Row]:
    """How many bins have each level that occurs, and how wide a bin is."""
    width_m = radials.range_nm[0] * 1852 / profile.bins
    rows: list[Row] = [
        ("bins", payload, "", str(profile.bins), "", f"of {profile.bits_per_bin} bits, {width_m:.1f} m each")
    ]
    for level, count in enumerate(np.bincount(radials.bins[0]).tolist()):
        name = profile.level_names[level]
        note = "UNUSUAL: a reserved code" if name == arinc708.RESERVED else ""
        if count:
            rows.append((name, "", f"{level:0{profile.bits_per_bin}b}", str(count), "bins", note))
    return rows


def _names(names: tuple[str, ...], code: int) -> str:
    return ", ".join(name for k, name in enumerate(names) if code >> k & 1) or "none"


def _bytes(text: str, lengths: Sequence[int]) -> bytes:
    digits = "".join(text.removeprefix("0x").removeprefix("0X").split())
    typed = repr(text if len(text) <= SHOWN else text[:SHOWN] + "...")
    if not set(digits) <= set(string.hexdigits):
        raise GatewayError(f"{typed} is not hexadecimal")
    if len(digits) % 2 or len(digits) // 2 not in lengths:
        needed = " to ".join(str(2 * length) for length in sorted({lengths[0], lengths[-1]}))
        mend = "a digit is missing or too many" if len(digits) % 2 else "write all of them, and spaces within quotes"
        raise GatewayError(f"{typed}: {len(digits)} digits given, {needed} needed: {mend}")
    return bytes.fromhex(digits)
