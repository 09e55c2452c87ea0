"""Every option of [monitor] as a page: `python -m gateway.option_table > docs/options.md`."""

import sys
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from monitor.settings import MonitorSettings

HEAD = """# Options of the monitor

Written by `python -m gateway.option_table`, from what the monitor checks. All stand below `[monitor]` in the rack file;
an option that is not there, a value of another kind (a number in quotes) and one out of its bounds are refused at the
start, by name.
Units are in the names or in the sentences.

| option | default | may be | what it is |
| --- | --- | --- | --- |
"""
BOUNDS = {Ge: ("ge", ">="), Gt: ("gt", ">"), Le: ("le", "<="), Lt: ("lt", "<")}


def page() -> str:
    """The page, Markdown."""
    return HEAD + "".join(f"| {' | '.join(row)} |\n" for row in _rows(MonitorSettings, ""))


def _rows(model: type[BaseModel], above: str) -> Iterator[tuple[str, str, str, str]]:
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _rows(kind, f"{name}.")
        else:
            yield f"`{above}{name}`", _default(field.default), _bounds(field), _sentence(model, field)


def _default(value: Any) -> str:
    return "not set" if value is None else f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _bounds(field: FieldInfo) -> str:
    kind = field.annotation
    if get_origin(kind) is Literal:
        return ", ".join(f'`"{choice}"`' for choice in get_args(kind))
    if kind is bool:
        return "`true`, `false`"
    kinds = {int: "whole", float: "number"}
    (number,) = [kinds[one] for one in (get_args(kind) or (kind,)) if one in kinds]
    limits = [f"{sign} {getattr(one, name):g}" for one in field.metadata for name, sign in [BOUNDS[type(one)]]]
    return f"{number} {' and '.join(limits)}"


def _sentence(model: type[BaseModel], field: FieldInfo) -> str:
    return field.description or " ".join((model.__doc__ or "").split())


if __name__ == "__main__":
    sys.stdout.write(page())
