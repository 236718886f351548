"""`odom config`: every setting with its default and unit."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel
    from pydantic.fields import FieldInfo

_UNITS = {
    "s": "s", "ms": "ms", "m": "m", "mm": "mm", "deg": "deg", "rad": "rad", "px": "px", "hz": "Hz", "mb": "MB",
    "mib": "MiB", "m_s": "m/s", "deg_s": "deg/s",
}  # fmt: skip
"""The unit that the end of a setting's name stands for; the longest one that fits counts."""


def config(
    file: Annotated[Path | None, typer.Option("--config", help="YAML file of settings to show the values of.")] = None,
    as_yaml: Annotated[bool, typer.Option("--yaml", help="Leave out units, defaults and meanings.")] = False,
) -> None:
    """Print every setting with its value, unit and meaning, and its default where that is another, as YAML.

    A setting is changed in a YAML file (`--config FILE` or ODOM_CONFIG) or in the environment, as in
    ODOM_WIRE__NAMESPACE=cam1. What is printed is such a file.

    Example: odom config > odom.yaml
    """
    import yaml

    from odom.service.settings import load_settings

    settings = load_settings(file)
    if as_yaml:
        typer.echo(yaml.safe_dump(settings.model_dump(mode="json"), sort_keys=False), nl=False)
        return
    typer.echo("\n".join(annotated(settings)))


def annotated(settings: "BaseModel") -> list[str]:
    """Return the settings as lines of YAML, values and remarks each in a column."""
    rows: list[tuple[str, str, str]] = []
    before: list[str] = []
    for entry in settings_list(settings):
        *sections, name = entry.name.split(".")
        for depth, section in enumerate(sections):
            if sections[: depth + 1] != before[: depth + 1]:
                rows.append((f"{'  ' * depth}{section}:", "", ""))
        before = sections
        changed = "" if entry.value == entry.default else f" (default {typed(entry.default)})"
        remark = f"# {entry.unit:<4} {entry.description}{changed}"
        rows.append((f"{'  ' * len(sections)}{name}:", typed(entry.value), remark))
    widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
    return [f"{key:<{widths[0]}} {value:<{widths[1]}}  {remark}".rstrip() for key, value, remark in rows]


def typed(value: object) -> str:
    """Return a value as it is typed into a file: lists and mappings as in JSON, which the environment takes, too."""
    import yaml

    if isinstance(value, list | tuple | dict) or not str(value).isprintable():
        return "".join(map(_escaped, json.dumps(value, ensure_ascii=False)))
    plain = value if value is None or isinstance(value, bool | int | float | str) else str(value)
    return yaml.safe_dump(plain, width=math.inf, allow_unicode=True).removesuffix("\n").removesuffix("\n...")


def _escaped(character: str) -> str:
    """Return a character as it may stand in a quoted text of YAML."""
    number = ord(character)
    return character if character.isprintable() else f"\\u{number:04x}" if number < 1 << 16 else f"\\U{number:08x}"


@dataclass(frozen=True)
class Setting:
    """One setting; `unit` is `-` for a number without one, a choice or a text."""

    name: str
    value: object
    default: object
    unit: str
    description: str


def settings_list(settings: "BaseModel", prefix: str = "") -> Iterator[Setting]:
    """Yield the settings of a model and of the models in it, in the order in which they are written down."""
    from pydantic import BaseModel
    from pydantic_core import PydanticUndefined

    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            yield from settings_list(value, f"{prefix}{name}.")
        else:
            default = field.get_default(call_default_factory=True)
            shown = "required" if default is PydanticUndefined else _plain(default)
            yield Setting(prefix + name, _plain(value), shown, _unit(name, field), field.description or "")


def _unit(name: str, field: "FieldInfo") -> str:
    if isinstance(field.json_schema_extra, dict) and "unit" in field.json_schema_extra:
        return str(field.json_schema_extra["unit"])
    suffixes = [suffix for suffix in _UNITS if name.endswith(f"_{suffix}")]
    return _UNITS[max(suffixes, key=len)] if suffixes else "-"


def _plain(value: Any) -> object:
    return getattr(value, "value", value)
