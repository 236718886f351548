"""The outcomes of all runs of the bench, as rows of a table, Markdown and JSON."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from odom.evaluation.robustness.axes import Axis, Level
from odom.evaluation.robustness.verdict import Verdict

_DOUBLE = 2.0
"""The factor by which the ATE has grown where it is said to double."""
_LEAST_SHARE = 0.5
"""An ATE over a smaller share of the frames that the unspoilt one covers is no figure of the recording: the odometry
has failed on it."""


@dataclass(frozen=True)
class AxisOutcome:
    """The verdicts of an axis by its levels, mild to hard; levels that were not run are missing."""

    axis: Axis
    verdicts: tuple[tuple[Level, Verdict], ...]

    def doubles_at(self, unspoilt: Verdict) -> str | None:
        """Return the label of the first level whose ATE is twice the unspoilt one, None where there is none.

        A level also fails when its ATE covers less than half of what the unspoilt one does.
        """
        for level, verdict in self.verdicts:
            if ratio(verdict, unspoilt) >= _DOUBLE or is_partial(verdict, unspoilt):
                return level.label
        return None


@dataclass(frozen=True)
class Outcomes:
    """What the bench found on one source, and how long that took: on the clock, and of all processors."""

    source: str
    seed: int
    unspoilt: Verdict
    axes: tuple[AxisOutcome, ...]
    wall_s: float
    cpu_s: float

    @property
    def runs(self) -> int:
        """How many runs there were, the unspoilt one included."""
        return 1 + sum(len(found.verdicts) for found in self.axes)


def ratio(verdict: Verdict, unspoilt: Verdict) -> float:
    """Return the ATE over the unspoilt one; infinite without one."""
    return verdict.ate_m / unspoilt.ate_m if verdict.ate_m is not None and unspoilt.ate_m else math.inf


def is_partial(verdict: Verdict, unspoilt: Verdict) -> bool:
    """Return whether the ATE is that of less than half of the frames that the unspoilt one covers, or there is none."""
    return verdict.ate_m is None or verdict.ate_share < _LEAST_SHARE * unspoilt.ate_share


COLUMNS = (
    "spoilt by", "level", "ATE mm", "of unspoilt", "over", "tracked", "LOST", "TRACKING and wrong", "NEES 1 s",
    "recovery s", "segments", "ATE doubles at",
)  # fmt: skip


def rows(outcomes: Outcomes) -> list[tuple[str, ...]]:
    """Return the rows of the table as text, under COLUMNS: the unspoilt run, then each axis with its levels."""
    found = [("nothing", "", *_figures(outcomes.unspoilt, outcomes.unspoilt), "")]
    for axis in outcomes.axes:
        doubles = axis.doubles_at(outcomes.unspoilt) or ("no level" if axis.verdicts else "")
        first = (axis.axis.title, doubles)
        for level, verdict in axis.verdicts:
            found.append((first[0], level.label, *_figures(verdict, outcomes.unspoilt), first[1]))
            first = ("", "")
    return found


def _figures(verdict: Verdict, unspoilt: Verdict) -> tuple[str, ...]:
    if verdict.error:
        return (verdict.error, *("-",) * 8)
    seconds = verdict.recovery_s
    return (
        "-" if verdict.ate_m is None else f"{1e3 * verdict.ate_m:.3g}",
        "-" if verdict.ate_m is None else f"x{ratio(verdict, unspoilt):.2f}",
        "-" if verdict.ate_m is None else _percent(verdict.ate_share),
        _percent(verdict.tracked),
        _percent(verdict.lost),
        _percent(verdict.wrong) if verdict.judged else "-",
        "-" if verdict.nees is None else f"{verdict.nees:.3g}",
        "-" if seconds is None else f"{'> ' if verdict.unrecovered else ''}{seconds:.2f}",
        str(verdict.segments),
    )


def _percent(share: float) -> str:
    """Return a share as text; 0 % and 100 % stand only for exactly none and all."""
    text = f"{100.0 * share:.1f} %"
    return text if 0.0005 <= share <= 0.9995 else "0" if share == 0 else "100 %" if share == 1 else f"{share:.3%}"


def markdown(outcomes: Outcomes) -> str:
    """Return the table as Markdown."""
    return _markdown(COLUMNS, rows(outcomes))


SHORT_COLUMNS = ("spoilt by", "levels", "ATE doubles at", "least tracked", "most TRACKING and wrong")


def short_markdown(outcomes: Outcomes) -> str:
    """Return a table of one row an axis as Markdown: its first level that fails, and the worst of all its levels."""
    found = []
    for axis in outcomes.axes:
        ran = [(level, verdict) for level, verdict in axis.verdicts if not verdict.error]
        if not ran:
            continue
        tracked = min(ran, key=lambda one: one[1].tracked)
        wrong = max(ran, key=lambda one: one[1].wrong)
        worst = f"{_percent(wrong[1].wrong)} at {wrong[0].label}" if wrong[1].wrong else "0"
        labels = ", ".join(level.label for level, _ in axis.verdicts)
        least = f"{_percent(tracked[1].tracked)} at {tracked[0].label}" if tracked[1].tracked < 1 else "100 %"
        found.append((axis.axis.title, labels, axis.doubles_at(outcomes.unspoilt) or "no level", least, worst))
    return _markdown(SHORT_COLUMNS, found)


def _markdown(columns: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    lines = [columns, ("---",) * len(columns), *cells]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def as_json(outcomes: Outcomes) -> dict[str, Any]:
    """Return everything that was found, as plain values for JSON."""
    return {
        "source": outcomes.source,
        "seed": outcomes.seed,
        "wall_s": outcomes.wall_s,
        "cpu_s": outcomes.cpu_s,
        "unspoilt": asdict(outcomes.unspoilt),
        "axes": {
            found.axis.name: {
                "title": found.axis.title,
                "ate_doubles_at": found.doubles_at(outcomes.unspoilt),
                "levels": {level.label: asdict(verdict) for level, verdict in found.verdicts},
            }
            for found in outcomes.axes
        },
    }


def by_axis(axes: Sequence[Axis], verdicts: dict[tuple[str, int], Verdict]) -> tuple[AxisOutcome, ...]:
    """Return the outcomes of axes whose verdicts are given by name and number of the level."""
    return tuple(
        AxisOutcome(
            axis,
            tuple(
                (level, verdicts[axis.name, number])
                for number, level in enumerate(axis.levels)
                if (axis.name, number) in verdicts
            ),
        )
        for axis in axes
    )
