"""`odom config`: every setting with its default and unit."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

_UNITS = {
    "s": "s", "ms": "ms", "m": "m", "mm": "mm", "deg": "deg", "rad": "rad", "px": "px", "hz": "Hz", "mb": "MB",
    "mib": "MiB", "m_s": "m/s", "deg_s": "deg/s",
}  # fmt: skip
"""The unit that the end of a setting's name stands for; the longest one that fits counts."""


def config(
    file: Annotated[Path | None, typer.Option("--config", help="YAML file of settings to show the values of.")] = None,
    as_yaml: Annotated[bool, typer.Option("--yaml", help="Print YAML, to start a file of one's own with.")] = False,
) -> None:
    """Print every setting with its value, default, unit and meaning.

    A setting is changed in a YAML file (`--config FILE` or ODOM_CONFIG) or in the environment, as in
    ODOM_WIRE__NAMESPACE=cam1.

    Example: odom config --yaml > odom.yaml
    """
    import yaml

    from odom.service.settings import load_settings

    settings = load_settings(file)
    if as_yaml:
        typer.echo(yaml.safe_dump(settings.model_dump(mode="json"), sort_keys=False), nl=False)
        return
    for entry in settings_list(settings):
        changed = "" if entry.value == entry.default else f" (default {entry.default})"
        typer.echo(f"{entry.name:<44} {entry.value} {entry.unit}{changed}  # {entry.description}")


@dataclass(frozen=True)
class Setting:
    """One setting; `unit` is `-` for a number without one, a choice or a text."""

    name: str
    value: object
    default: object
    unit: str
    description: str


def settings_list(settings: BaseModel, prefix: str = "") -> Iterator[Setting]:
    """Yield the settings of a model and of the models in it, in the order in which they are written down."""
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            yield from settings_list(value, f"{prefix}{name}.")
        else:
            default = field.get_default(call_default_factory=True)
            shown = "required" if default is PydanticUndefined else _plain(default)
            yield Setting(prefix + name, _plain(value), shown, _unit(name, field), field.description or "")


def _unit(name: str, field: FieldInfo) -> str:
    if isinstance(field.json_schema_extra, dict) and "unit" in field.json_schema_extra:
        return str(field.json_schema_extra["unit"])
    suffixes = [suffix for suffix in _UNITS if name.endswith(f"_{suffix}")]
    return _UNITS[max(suffixes, key=len)] if suffixes else "-"


def _plain(value: Any) -> object:
    return getattr(value, "value", value)
