"""Where settings come from: the environment, then a YAML file, then the defaults. Loads no part of the project."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError, create_model
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from odom.errors import ConfigError

Part = TypeVar("Part", bound=BaseModel)

CONFIG_ENVIRONMENT = "ODOM_CONFIG"
"""Environment variable with the YAML file, if the command line names none."""


class Sourced(BaseSettings):
    """Settings whose fields are the parts; `ODOM_WIRE__NAMESPACE` in the environment sets `wire.namespace`."""

    model_config = SettingsConfigDict(env_prefix="ODOM_", env_nested_delimiter="__", extra="ignore", frozen=True)

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Return the sources of values, the first one winning: environment, then file."""
        return env_settings, init_settings


def read_file(config: Path | None) -> dict[str, Any]:
    """Return the sections of the YAML file `config` or `$ODOM_CONFIG`, none without either.

    Raises ConfigError when it cannot be read or is no mapping.
    """
    named = os.environ.get(CONFIG_ENVIRONMENT)
    path = config or (Path(named) if named else None)
    if path is None:
        return {}
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} cannot be read as YAML: {error}") from error
    if content is not None and not isinstance(content, dict):
        raise ConfigError(f"{path} has no sections: see `odom config --yaml`")
    return content or {}


def refusal(error: ValidationError) -> ConfigError:
    """Return the error that names each setting that is unknown or out of range."""
    problems = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
    return ConfigError(f"settings: {problems} (see `odom config`)")


def part_settings(part: str, model: type[Part], config: Path | None, given: Mapping[str, Any]) -> Part:
    """Return the settings of one part: what is `given` (and not None) over environment over the file over defaults.

    The file's other sections are not looked at, so that a sensor or a viewer need not load the odometry. Raises
    ConfigError for a value that cannot be used.
    """
    fields: dict[str, Any] = {part: (model, model())}
    section = read_file(config).get(part)
    try:
        parts = create_model("Part", __base__=Sourced, **fields)(**({part: section} if section else {}))
        settings = getattr(parts, part)
        return model.model_validate({**settings.model_dump(), **{k: v for k, v in given.items() if v is not None}})
    except ValidationError as error:
        raise refusal(error) from error
