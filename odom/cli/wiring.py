"""Command line options that several commands share, as settings."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from odom.errors import ConfigError
from odom.wire import WireSettings


def wire_settings(
    config: Path | None,
    connect: Sequence[str] | None,
    listen: Sequence[str] | None,
    mode: str | None,
    namespace: str | None,
) -> WireSettings:
    """Return the session's settings from file and environment, with what the command line says instead.

    Raises ConfigError for a value that cannot be used.
    """
    from pydantic import ValidationError

    from odom.service.settings import load_settings

    given = {"connect": connect or None, "listen": listen or None, "mode": mode, "namespace": namespace}
    settings = load_settings(config).wire
    try:
        return WireSettings(**{**settings.model_dump(), **{k: v for k, v in given.items() if v is not None}})
    except ValidationError as error:
        raise ConfigError("; ".join(f"--{e['loc'][0]}: {e['msg']}" for e in error.errors())) from error


def pairs(option: str, values: Iterable[str] | None) -> tuple[tuple[str, str], ...]:
    """Split `name=value` arguments; raises ConfigError for one without `=`."""
    split = tuple((name, value) for name, _, value in (text.partition("=") for text in values or ()))
    if any(not name or not value for name, value in split):
        raise ConfigError(f"{option} {' '.join(values or ())}: give name=value")
    return split
