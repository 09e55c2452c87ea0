"""Where in a TOML file something stands, for the errors that name it."""

from collections.abc import MutableMapping
from pathlib import Path
from typing import Any

OTHER = "\0"  # a value that no file has


def place(path: Path, text: str, *keys: str | int) -> str:
    """The file and the line, counted from 1, of the value at `keys` in its text: "labels.toml:12".

    The line of a table is that of its first value. What is not there stands where it would belong, and where no line
    can be said the file is named alone.
    """
    from tomlkit.exceptions import TOMLKitError  # noqa: PLC0415 # only where there is an error, as it takes its time

    for depth in range(len(keys), 0, -1):
        try:
            return f"{path}:{_line(text, *keys[:depth])}"
        except (TOMLKitError, LookupError, TypeError, ValueError):
            continue
    return str(path)


def _line(text: str, *keys: str | int) -> int:
    """Write another value there, all else being kept as it stands: the first difference is where the value was."""
    import tomlkit  # noqa: PLC0415 # as above

    document = tomlkit.parse(text)
    *outer, last = keys
    holder: Any = document
    for key in outer:
        holder = holder[key]
    value = holder[last]
    if isinstance(value, MutableMapping):
        value[next(iter(value), OTHER)] = OTHER
    else:
        holder[last] = OTHER
    both = enumerate(zip(text, tomlkit.dumps(document), strict=False))
    return text.count("\n", 0, next((k for k, (old, new) in both if old != new), len(text))) + 1
