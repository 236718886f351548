"""`--ros2 [DOMAIN]`: an option whose value may be left out, which Typer does not know."""

import os
from collections.abc import Iterable
from typing import Any

from typer.core import TyperCommand

from odom.errors import ConfigError

_OPTION = "--ros2"
_LAST_DOMAIN = 232
"""The highest domain of DDS whose ports are below 65536 (RTPS, 9.6.2.3)."""
DOMAIN_ENVIRONMENT = "ROS_DOMAIN_ID"
"""Environment variable with the domain of all ROS 2 processes; without it they are in domain 0."""


class WithRos2Domain(TyperCommand):
    """A command that takes `--ros2` without a value for the domain of the environment."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments with the value of `--ros2` filled in; `ctx` is Typer's own kind of context."""
        return super().parse_args(ctx, filled_in(args))


def filled_in(arguments: Iterable[str]) -> list[str]:
    """Return the arguments with `--ros2=DOMAIN` for each `--ros2` that no number follows."""
    filled: list[str] = []
    for argument in arguments:
        if filled and filled[-1] == _OPTION and not argument.isdecimal():
            filled[-1] = _of_environment()
        filled.append(argument)
    if filled and filled[-1] == _OPTION:
        filled[-1] = _of_environment()
    return filled


def _of_environment() -> str:
    return f"{_OPTION}={domain_of_environment()}"


def domain_of_environment() -> int:
    """Return the domain of the environment; raises ConfigError for what is none."""
    text = os.environ.get(DOMAIN_ENVIRONMENT) or "0"
    if not text.isdecimal() or int(text) > _LAST_DOMAIN:
        raise ConfigError(f"{DOMAIN_ENVIRONMENT}={text}: a ROS domain is a number from 0 to {_LAST_DOMAIN}")
    return int(text)
