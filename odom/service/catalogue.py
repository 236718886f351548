"""Settings as a flat list of name, value, default, unit and meaning."""

import dataclasses
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

_UNITS = {
    "_s": "s",
    "_ms": "ms",
    "_m": "m",
    "_mm": "mm",
    "_deg": "deg",
    "_rad": "rad",
    "_px": "px",
    "_hz": "Hz",
    "_mb": "MB",
    "_mib": "MiB",
    "_m_s": "m/s",
    "_deg_s": "deg/s",
}


@dataclasses.dataclass(frozen=True)
class Entry:
    """One setting; `unit` is `-` for a number without one, a choice or a text."""

    name: str
    value: object
    default: object
    unit: str
    description: str


def catalogue(settings: BaseModel, prefix: str = "") -> Iterator[Entry]:
    """Yield the settings of a model and of the models in it, in the order in which they are written down."""
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            yield from catalogue(value, f"{prefix}{name}.")
        else:
            default = field.get_default(call_default_factory=True)
            shown = "required" if default is PydanticUndefined else _plain(default)
            yield Entry(prefix + name, _plain(value), shown, _unit(name, field), field.description or "")


def _unit(name: str, field: FieldInfo) -> str:
    if isinstance(field.json_schema_extra, dict) and "unit" in field.json_schema_extra:
        return str(field.json_schema_extra["unit"])
    suffixes = [suffix for suffix in _UNITS if name.endswith(suffix)]
    return _UNITS[max(suffixes, key=len)] if suffixes else "-"


def _plain(value: Any) -> object:
    return getattr(value, "value", value)
