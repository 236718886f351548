"""Command line options that several commands share, as settings."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from odom.errors import ConfigError
from odom.wire import WireSettings

_CONFIG_ENVIRONMENT = "ODOM_CONFIG"


def wire_settings(
    config: Path | None,
    connect: Sequence[str] | None,
    listen: Sequence[str] | None,
    mode: str | None,
    namespace: str | None,
) -> WireSettings:
    """Return the session's settings: command line over environment over the file's section `wire` over defaults.

    The other sections are not looked at, so that a sensor or a recorder need not load the odometry. Raises ConfigError
    for a value that cannot be used.
    """
    from pydantic import ValidationError
    from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

    class Environment(BaseSettings):
        model_config = SettingsConfigDict(env_prefix="ODOM_", env_nested_delimiter="__", extra="ignore")
        wire: WireSettings = WireSettings()

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

    file: dict[str, Any] = {"wire": _section(config)}
    given = {"connect": connect or None, "listen": listen or None, "mode": mode, "namespace": namespace}
    try:
        settings = Environment(**file).wire
        return WireSettings.model_validate(
            {**settings.model_dump(), **{k: v for k, v in given.items() if v is not None}}
        )
    except ValidationError as error:
        problems = "; ".join(f"wire.{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise ConfigError(f"settings: {problems} (see `odom config`)") from error


def pairs(option: str, values: Iterable[str] | None) -> tuple[tuple[str, str], ...]:
    """Split `name=value` arguments; raises ConfigError for one without `=`."""
    split = tuple((name, value) for name, _, value in (text.partition("=") for text in values or ()))
    if any(not name or not value for name, value in split):
        raise ConfigError(f"{option} {' '.join(values or ())}: give name=value")
    return split


def _section(config: Path | None) -> dict[str, Any]:
    import yaml

    path = config or (Path(named) if (named := os.environ.get(_CONFIG_ENVIRONMENT)) else None)
    if path is None:
        return {}
    try:
        content = yaml.safe_load(path.read_text()) or {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} cannot be read as YAML: {error}") from error
    section = content.get("wire") if isinstance(content, dict) else None
    return section if isinstance(section, dict) else {}
