"""Where settings come from: the environment, then a YAML file, then the defaults. Loads no part of the project."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError, create_model
from pydantic.fields import FieldInfo
from pydantic_settings import BaseSettings, EnvSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict

from odom.errors import ConfigError
from odom.service.settings_errors import nearest, refusal

Part = TypeVar("Part", bound=BaseModel)

PREFIX, NESTED = "ODOM_", "__"
"""How the environment variable of a setting begins, and what separates its parts."""
CONFIG_ENVIRONMENT = "ODOM_CONFIG"
"""Environment variable with the YAML file, if the command line names none."""


class _Loader(yaml.SafeLoader):
    """YAML whose names stand once each: of two sections of a name the first would be lost in silence."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """Return the mapping as it is written; raises ConfigError for a name that stands twice in it."""
        node = super().compose_mapping_node(anchor)
        seen = set()
        for name, _ in node.value:
            if not isinstance(name, yaml.ScalarNode) or name.tag != self.DEFAULT_SCALAR_TAG:
                continue
            if name.value in seen:
                at = name.start_mark
                raise ConfigError(f"{at.name}, line {at.line + 1}: {name.value!r:.60} stands twice; join the two")
            seen.add(name.value)
        return node


class _Environment(EnvSettingsSource):
    """The environment; where a list may stand, a value that is not JSON is taken as text."""

    def decode_complex_value(self, field_name: str, field: FieldInfo, value: Any) -> Any:
        """Return the value of a JSON text, or the text."""
        try:
            return json.loads(value)
        except (ValueError, RecursionError):
            return value


class Sourced(BaseSettings):
    """Settings whose fields are the parts; `ODOM_WIRE__NAMESPACE` in the environment sets `wire.namespace`."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, env_nested_delimiter=NESTED, extra="ignore", frozen=True)

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
        return _Environment(settings_cls), init_settings


def read_file(config: Path | None) -> dict[str, Any]:
    """Return the sections of the YAML file `config` or `$ODOM_CONFIG`, none without either; empty ones are left out.

    Raises ConfigError when it cannot be read, is no mapping, or says something twice.
    """
    named = os.environ.get(CONFIG_ENVIRONMENT)
    path = config or (Path(named) if named else None)
    if path is None:
        return {}
    try:
        with path.open() as file:
            content = yaml.load(file, _Loader)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} cannot be read as YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise ConfigError(f"{path} cannot be read as YAML: it is nested too deeply") from error
    if content is not None and not isinstance(content, dict):
        raise ConfigError(f"{path} has no sections: see `odom config`")
    return {name: section for name, section in (content or {}).items() if section is not None}


def load(model: type[Part], content: Mapping[Any, Any]) -> Part:
    """Return the settings of a `Sourced` model by the environment, the sections of a file, and the defaults.

    Raises ConfigError naming each setting that is unknown or does not fit.
    """
    if unknown := [name for name in content if name not in model.model_fields]:
        listed = ", ".join(f"{name!r:.60}{nearest(str(name), model.model_fields)}" for name in unknown[:5])
        raise ConfigError(f"no sections {listed}: there are {', '.join(model.model_fields)}")
    try:
        return model(**content)
    except ValidationError as error:
        raise refusal(error, model) from error
    except RecursionError as error:
        raise ConfigError("settings: nested too deeply (see `odom config`)") from error


def part_settings(part: str, model: type[Part], config: Path | None, given: Mapping[str, Any]) -> Part:
    """Return the settings of one part, by precedence: `given` (not None), environment, file, defaults.

    The file's other sections are not looked at, so that a sensor or a viewer need not load the odometry. Raises
    ConfigError for a value that cannot be used.
    """
    fields: dict[str, Any] = {part: (model, model())}
    content = read_file(config)
    section = {part: content[part]} if part in content else {}
    settings: Part = getattr(load(create_model("Part", __base__=Sourced, **fields), section), part)
    try:
        return model.model_validate({**settings.model_dump(), **{k: v for k, v in given.items() if v is not None}})
    except ValidationError as error:
        raise refusal(error, model) from error
