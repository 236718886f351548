"""Command line options that several commands share, as settings."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from odom.errors import ConfigError
from odom.wire import WireSettings

Part = TypeVar("Part", bound=BaseModel)


def part_settings(part: str, model: type[Part], config: Path | None, given: Mapping[str, Any]) -> Part:
    """Return the settings of one part: what is `given` (and not None) over environment over the file over defaults.

    The file's other sections are not looked at, so that a sensor or a viewer need not load the odometry. Raises
    ConfigError for a value that cannot be used.
    """
    from pydantic import ValidationError, create_model

    from odom.service.sources import Sourced, read_file, refusal

    fields: dict[str, Any] = {part: (model, model())}
    section = read_file(config).get(part)
    try:
        parts = create_model("Part", __base__=Sourced, **fields)(**({part: section} if section else {}))
        settings = getattr(parts, part)
        return model.model_validate({**settings.model_dump(), **{k: v for k, v in given.items() if v is not None}})
    except ValidationError as error:
        raise refusal(error) from error


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
