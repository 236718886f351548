"""Command line options that several commands share, as settings."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from odom.errors import ConfigError
from odom.wire import WireSettings

_CONFIG_ENVIRONMENT = "ODOM_CONFIG"

Part = TypeVar("Part", bound=BaseModel)


def part_settings(part: str, model: type[Part], config: Path | None, given: Mapping[str, Any]) -> Part:
    """Return the settings of one part: what is `given` (and not None) over environment over the file over defaults.

    The file's other sections are not looked at, so that a sensor or a viewer need not load the odometry. Raises
    ConfigError for a value that cannot be used.
    """
    from pydantic import ValidationError, create_model
    from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

    class Environment(BaseSettings):
        model_config = SettingsConfigDict(env_prefix="ODOM_", env_nested_delimiter="__", extra="ignore")

        @classmethod
        def settings_customise_sources(
            cls,
            settings_cls: type[BaseSettings],
            init_settings: PydanticBaseSettingsSource,
            env_settings: PydanticBaseSettingsSource,
            dotenv_settings: PydanticBaseSettingsSource,
            file_secret_settings: PydanticBaseSettingsSource,
        ) -> tuple[PydanticBaseSettingsSource, ...]:
            return env_settings, init_settings

    fields: dict[str, Any] = {part: (model, model())}
    file: dict[str, Any] = {part: _section(config, part)}
    try:
        settings = getattr(create_model("Environment", __base__=Environment, **fields)(**file), part)
        return model.model_validate({**settings.model_dump(), **{k: v for k, v in given.items() if v is not None}})
    except ValidationError as error:
        problems = "; ".join(f"{part}.{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise ConfigError(f"settings: {problems} (see `odom config`)") from error


def wire_settings(
    config: Path | None,
    connect: Sequence[str] | None,
    listen: Sequence[str] | None,
    mode: str | None,
    namespace: str | None,
) -> WireSettings:
    """Return the session's settings; see `part_settings`."""
    given = {"connect": connect or None, "listen": listen or None, "mode": mode, "namespace": namespace}
    return part_settings("wire", WireSettings, config, given)


def pairs(option: str, values: Iterable[str] | None) -> tuple[tuple[str, str], ...]:
    """Split `name=value` arguments; raises ConfigError for one without `=`."""
    split = tuple((name, value) for name, _, value in (text.partition("=") for text in values or ()))
    if any(not name or not value for name, value in split):
        raise ConfigError(f"{option} {' '.join(values or ())}: give name=value")
    return split


def _section(config: Path | None, part: str) -> dict[str, Any]:
    import yaml

    path = config or (Path(named) if (named := os.environ.get(_CONFIG_ENVIRONMENT)) else None)
    if path is None:
        return {}
    try:
        content = yaml.safe_load(path.read_text()) or {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} cannot be read as YAML: {error}") from error
    section = content.get(part) if isinstance(content, dict) else None
    return section if isinstance(section, dict) else {}
