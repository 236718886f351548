"""What a smaller and a larger value of each tuned number does to accuracy (ATE) and an honest covariance (NEES)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, unique
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path
from typing import Any

from odom.evaluation.robustness.verdict import Verdict
from odom.geometry.tuning import documented

PACKAGES = ("registration", "frontend", "backend")
"""Packages of the algorithms: their `tuning` modules hold the numbers."""
_NOT_IN_THE_ODOMETRY = ("paper", "cloud_features")
"""Their packages for the paper's tables and physical experiment: none of their numbers affects the odometry."""

_SHARES = {"tracked": "tracked", "lost": "LOST", "wrong": "TRACKING and wrong"}
"""Shares of the frames that are remarked on where they differ; they do not change the order of the table."""
_REMARKED = 0.01
"""They do where they differ by more than this share of the frames."""


@unique
class Level(Enum):
    """How a number is set: as it is, or divided or multiplied by a factor."""

    LESS = "less"
    AS_IS = "as is"
    MORE = "more"


@dataclass(frozen=True)
class TunedNumber:
    """A field of a package's `Tuning`; `key` is its `package.name`, as `odom.geometry.tuning.OVERRIDES` has it.

    What is tried are its `value` divided and multiplied by `factor`.
    """

    key: str
    value: float | int
    unit: str
    factor: float = 2.0

    def at(self, level: Level) -> float | int | None:
        """Return the number at a level, None where that is the same number; whole ones stay whole and at least 1."""
        if level is Level.AS_IS:
            return self.value
        changed = self.value / self.factor if level is Level.LESS else self.value * self.factor
        if isinstance(self.value, int):
            changed = max(1, math.floor(changed)) if level is Level.LESS else math.ceil(round(changed, 9))
        return None if changed == self.value else changed


@dataclass(frozen=True)
class Sensitivity:
    """The verdicts on one number, by what was run over and by level; a level that was not run is missing."""

    number: TunedNumber
    outcomes: dict[str, dict[Level, Verdict]]

    @property
    def largest_change(self) -> float:
        """The largest factor (>= 1) between an ATE or NEES and the usual one; infinite where a run failed."""
        return max(
            (
                _change(getattr(levels[Level.AS_IS], figure), getattr(outcome, figure))
                for levels in self.outcomes.values()
                for level, outcome in levels.items()
                for figure in ("ate_m", "nees")
                if level is not Level.AS_IS
            ),
            default=1.0,
        )


def tuned_numbers(*only: str, factor: float = 2.0) -> list[TunedNumber]:
    """Return the numbers of every `Tuning` class whose `package.name` matches one of the patterns; without any, all.

    They are to be divided and multiplied by `factor`.
    """
    root = Path(__file__).parents[1]
    folders = [path.parent for package in PACKAGES for path in sorted((root / package).rglob("tuning.py"))]
    found = []
    for folder in folders:
        place = ".".join(folder.relative_to(root).parts)
        if folder.name not in _NOT_IN_THE_ODOMETRY:
            found += numbers_of(place, import_module(f"odom.{place}.tuning").Tuning)
    chosen = [number for number in found if not only or any(fnmatch(number.key, pattern) for pattern in only)]
    return [replace(number, factor=factor) for number in chosen]


def numbers_of(package: str, tuning: type[Any]) -> list[TunedNumber]:
    """Return the numbers of one `Tuning` class; switches are left out, they have no more or less."""
    return [
        TunedNumber(f"{package}.{name}", value, provenance.unit)
        for name, (value, provenance) in documented(tuning).items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]


def changes(number: TunedNumber) -> dict[Level, float | int]:
    """Return the values other than the usual one that are to be tried."""
    values = {level: number.at(level) for level in (Level.LESS, Level.MORE)}
    return {level: value for level, value in values.items() if value is not None}


def by_effect(found: Iterable[Sensitivity]) -> list[Sensitivity]:
    """Return the numbers sorted by their largest change, failures first, equal ones by name."""
    return sorted(found, key=lambda one: (-one.largest_change, one.number.key))


COLUMNS = (
    "number", "value", "unit", "largest change", "source",
    "ATE mm: less", "as is", "more", "NEES: less", "as is", "more", "remarks",
)  # fmt: skip


def cells(found: Sequence[Sensitivity]) -> list[tuple[str, ...]]:
    """Return the rows of the table as text, under COLUMNS: one row per number and source, ratios in brackets."""
    rows = []
    for one in found:
        first = (one.number.key, f"{one.number.value:.6g}", one.number.unit, _size(one.largest_change))
        for source, levels in one.outcomes.items():
            ate = tuple(_figure(levels, level, "ate_m", 1e3) for level in Level)
            nees = tuple(_figure(levels, level, "nees", 1.0) for level in Level)
            rows.append((*first, source, *ate, *nees, _remarks(levels)))
            first = ("", "", "", "")
    return rows


def markdown(found: Sequence[Sensitivity]) -> str:
    """Return the table as Markdown."""
    lines = [COLUMNS, ("---",) * len(COLUMNS), *cells(found)]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def as_json(found: Sequence[Sensitivity]) -> list[dict[str, Any]]:
    """Return everything that was found, as plain values for JSON; a change that is no number is None."""
    return [
        {
            "number": one.number.key,
            "unit": one.number.unit,
            "values": {level.value: one.number.at(level) for level in Level},
            "largest_change": one.largest_change if math.isfinite(one.largest_change) else None,
            "outcomes": {
                source: {level.value: vars(outcome) for level, outcome in levels.items()}
                for source, levels in one.outcomes.items()
            },
        }
        for one in found
    ]


def _change(usual: float | None, changed: float | None) -> float:
    if not usual:  # nothing to compare with: no truth, or a run too short
        return 1.0
    if not changed:
        return math.inf
    return max(usual / changed, changed / usual)


def _size(change: float) -> str:
    if math.isinf(change):
        return "failed"
    return "none" if change == 1.0 else f"x{change:.3g}"


def _figure(levels: dict[Level, Verdict], level: Level, name: str, scale: float) -> str:
    usual, value = (getattr(levels.get(which, Verdict()), name) for which in (Level.AS_IS, level))
    if value is None:
        return "failed" if level in levels and levels[level].error else "-"
    text = f"{scale * value:.4g}"
    return text if level is Level.AS_IS or not usual else f"{text} ({value / usual:.2f})"


def _remarks(levels: dict[Level, Verdict]) -> str:
    said, usual = [], levels[Level.AS_IS]
    for level, verdict in levels.items():
        if verdict.error:
            said.append(f"{level.value}: {verdict.error}")
            continue
        shares = [(words, getattr(verdict, name), getattr(usual, name)) for name, words in _SHARES.items()]
        changed = [f"{new:.0%} {words} (of {old:.0%})" for words, new, old in shares if abs(new - old) > _REMARKED]
        said += [f"{level.value}: {', '.join(changed)}"] if changed else []
    return "; ".join(said)
