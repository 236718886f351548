"""Numbers that were chosen by trial: each says its unit, what depends on it, and where it comes from.

A package keeps its numbers in a frozen dataclass `Tuning`, whose fields are made by `tuned`, and in one value of it,
`TUNING = in_use(Tuning)`. They are not settings: users need not touch them. `odom bench sensitivity` tries less and
more of each one in a process of its own, by means of `OVERRIDES`.
"""

from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

OVERRIDES: dict[str, float] = {}
"""Other values, by `package.name`; only what is set before the package is first imported counts."""

SWEEP = "trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md"
BODIES = "bodies painted into fr1_xyz and fr1_rpy, people in the arena, fr1 as it is"
"""Sources that numbers of several packages have."""

T = TypeVar("T")


@dataclass(frozen=True)
class Provenance:
    """What is known of a tuned number: its `unit`, the `effect` of a smaller or larger one, and its `source`."""

    unit: str
    effect: str
    source: str


def tuned(value: float | int, *, unit: str, effect: str, source: str) -> Any:
    """Return a dataclass field whose default is `value`, documented as the project demands of every tuned number.

    `unit`: SI or px, `1` for a share or a count. `effect`: what gets worse when it is smaller and when it is larger.
    `source`: an article, a quantile, a data sheet, or the measurement that chose it.
    """
    return field(default=value, metadata={"provenance": Provenance(unit, effect, source)})


def in_use(tuning: type[T]) -> T:
    """Return the values of a package's `Tuning` class, with the `OVERRIDES` that name them."""
    package = tuning.__module__.removeprefix("odom.").removesuffix(".tuning")
    names = set(documented(tuning))
    changed = {
        name: value
        for key, value in OVERRIDES.items()
        for place, _, name in [key.rpartition(".")]
        if place == package and name in names
    }
    return replace(tuning(), **changed)  # type: ignore[type-var]  # every Tuning is a dataclass


def documented(tuning: type[Any]) -> dict[str, tuple[Any, Provenance]]:
    """Return default and provenance of every field of a `Tuning` class, by name."""
    return {f.name: (f.default, f.metadata["provenance"]) for f in fields(tuning)}
