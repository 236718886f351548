"""What is wrong with settings, in one line: name, value, what would fit."""

import os
from collections.abc import Collection, Iterator, Mapping
from difflib import get_close_matches
from reprlib import Repr
from typing import TYPE_CHECKING, Any, get_args

from odom.errors import ConfigError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

_MOST = 5
"""Problems that are named: nobody reads a longer line."""
_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60  # characters of a value that are shown
_NOT_SETTINGS = ("ODOM_CONFIG", "ODOM_LOG_", "ODOM_COUNT", "ODOM_PARENT_PID", "ODOM_FOLDER_HELD", "ODOM_SHARED_DATA",
           "ODOM_SOAK_MINUTES", "ODOM_TEST_")  # fmt: skip
"""How variables begin that are no settings: of the command line, between `odom run` and its children, of the tests."""
_SECTIONS = ("ODOMETRY", "WIRE", "SERVICE", "VIEWER")
"""Parts of `Settings`, whose variables are looked at, and refused, by the commands that use them."""


def refusal(error: "ValidationError", model: "type[BaseModel]") -> ConfigError:
    """Return the error that names each setting that is unknown or does not fit, by its variable where that is set."""
    known = list(names(model))
    problems = [_problem(dict(each), known) for each in error.errors()]
    more = f"; and {len(problems) - _MOST} more" if len(problems) > _MOST else ""
    return ConfigError(f"settings: {'; '.join(problems[:_MOST])}{more} (see `odom config`)")


def names(model: "type[BaseModel]", prefix: str = "") -> Iterator[str]:
    """Yield the names of a model's settings: `wire.namespace`."""
    for name, field in model.model_fields.items():
        nested = next((t for t in (field.annotation, *get_args(field.annotation)) if _is_model(t)), None)
        if nested is None:
            yield prefix + name
        else:
            yield from names(nested, f"{prefix}{name}.")


def variable(name: str) -> str:
    """Return the environment's variable of a setting: `ODOM_WIRE__NAMESPACE`."""
    return "ODOM_" + name.replace(".", "__").upper()


def nearest(name: str, known: Collection[str]) -> str:
    """Return a hint at the nearest known name, empty when none is near."""
    found = get_close_matches(name, known, n=1)
    return f" (did you mean {found[0]}?)" if found else ""


def stray_variables(environment: Mapping[str, str]) -> list[str]:
    """Return the variables that begin like settings and belong to no section of them."""
    sections = {f"ODOM_{section}" for section in _SECTIONS}
    stray = (name for name in environment if name.upper().startswith("ODOM_") and not name.startswith(_NOT_SETTINGS))
    return sorted(name for name in stray if name.upper().split("__")[0] not in sections)


def _problem(problem: Mapping[str, Any], known: Collection[str]) -> str:
    name = ".".join(map(str, problem["loc"]))
    where = variable(name) if any(key.upper() == variable(name) for key in os.environ) else name
    if problem["type"] == "extra_forbidden":
        return f"{_SHORT.repr(where)[1:-1]}: there is no such setting{nearest(name, known)}"
    why = " ".join(str(problem["msg"]).split())
    return f"{_SHORT.repr(where)[1:-1]} = {_SHORT.repr(problem['input'])}: {why[:1].lower()}{why[1:]}"


def _is_model(kind: object) -> bool:
    from pydantic import BaseModel

    return isinstance(kind, type) and issubclass(kind, BaseModel)
