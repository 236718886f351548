"""Options of a source, given as texts on the command line (`--option name=value`)."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from odom.errors import ConfigError

T = TypeVar("T")


def read_options(kind: str, model: type[T], texts: Mapping[str, str]) -> T:
    """Return the pydantic `model` of options given as texts; raises ConfigError naming the one that does not fit."""
    try:
        return TypeAdapter(model).validate_python(texts)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        fields: dict[str, Any] = getattr(model, "__pydantic_fields__", {})
        raise ConfigError(f"{kind} option {name}: {first['msg']} (options: {', '.join(fields)})") from error
