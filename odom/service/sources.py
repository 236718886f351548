"""Where settings come from: the environment, then a YAML file, then the defaults. Loads no part of the project."""

import os
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from odom.errors import ConfigError

CONFIG_ENVIRONMENT = "ODOM_CONFIG"
"""Names the YAML file where the command line does not."""


class Sourced(BaseSettings):
    """Settings whose fields are the parts; `ODOM_WIRE__NAMESPACE` is the environment's word for `wire.namespace`."""

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
        """Let the environment win over what was read from the file."""
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
