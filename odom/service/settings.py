"""Every setting of the service, nested by part: from the environment, then a YAML file, then the defaults."""

import os
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, Field, ValidationError
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from odom.backend import OdometrySettings
from odom.errors import ConfigError
from odom.viewer import ViewerSettings
from odom.wire import WireSettings

CONFIG_ENVIRONMENT = "ODOM_CONFIG"


class ServiceSettings(BaseModel, frozen=True, extra="forbid"):
    """What the odometry process and `odom run` do beside the odometry itself."""

    status_period_s: float = Field(0.2, gt=0, description="between two status messages of an unchanged state")
    features_period_s: float = Field(0.066, gt=0, description="between two feature clouds for the viewer")
    map_period_s: float = Field(0.5, gt=0, description="between two paths with landmarks for the viewer")
    live_frames: int = Field(3, ge=1, description="frames of a live source that may wait; the newest win")
    stop_timeout_s: float = Field(15.0, gt=0, description="a child may take this long to end before it is killed")


class Settings(BaseSettings):
    """All settings; see `odom config`."""

    model_config = SettingsConfigDict(env_prefix="ODOM_", env_nested_delimiter="__", extra="ignore", frozen=True)

    odometry: OdometrySettings = OdometrySettings()
    wire: WireSettings = WireSettings()
    service: ServiceSettings = ServiceSettings()
    viewer: ViewerSettings = ViewerSettings()

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


def load_settings(config: Path | None = None) -> Settings:
    """Return the settings of the environment, the YAML file `config` (or `$ODOM_CONFIG`) and the defaults.

    Raises ConfigError naming each setting that is unknown or out of range.
    """
    path = config or (Path(named) if (named := os.environ.get(CONFIG_ENVIRONMENT)) else None)
    try:
        return Settings(**(_read(path) if path else {}))
    except ValidationError as error:
        problems = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise ConfigError(f"settings: {problems} (see `odom config`)") from error


def _read(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} cannot be read as YAML: {error}") from error
    if content is None:
        return {}
    if not isinstance(content, dict) or not content.keys() <= Settings.model_fields.keys():
        raise ConfigError(f"{path} has sections other than {', '.join(Settings.model_fields)}: see `odom config`")
    return content
