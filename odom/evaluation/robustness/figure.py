"""The picture of the robustness bench: one panel for each axis, the ATE above the shares of frames by outcome."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from odom.evaluation.log_axis import number_plainly
from odom.evaluation.robustness.outcomes import AxisOutcome, Outcomes, is_partial
from odom.evaluation.robustness.verdict import Verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, WRONG, TRACKED, UNCERTAIN, LOST = "#1a1a1a", "#D55E00", "#CFE8F5", "#F5E3A0", "#B8B8B8"
"""Of M. Okabe and K. Ito's palette and tints of it; what is wrong is the only strong colour."""
_NAMES = {WRONG: "TRACKING and wrong", TRACKED: "tracked", UNCERTAIN: "UNCERTAIN", LOST: "LOST"}

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "font.size": 9, "axes.titlesize": 10, "axes.titleweight": "bold",
    "axes.titlelocation": "left", "axes.spines.top": False, "axes.edgecolor": "#666666", "axes.linewidth": 0.8,
    "text.parse_math": False, "legend.frameon": False, "xtick.color": "#444444", "ytick.color": "#444444",
}  # fmt: skip
_COLUMNS = 4
"""Axes beside each other: four fit on a page's width with their labels readable."""
_TITLE = 36
"""Characters of a line of a panel's title, which is as wide as the panel then."""
_ROOM = 1.6
"""Space on the logarithmic axis beyond the least and the largest ATE, a factor."""


def plot(outcomes: Outcomes, path: Path) -> None:
    """Draw each axis from unspoilt to hard: bars show the shares of frames by state, the line the ATE (logarithmic)."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = [found for found in outcomes.axes if found.verdicts]
    columns = min(_COLUMNS, len(shown) + 1)
    lines = ceil((len(shown) + 1) / columns)
    with rc_context(_STYLE):
        figure = Figure(figsize=(3.4 * columns + 0.6, 2.55 * lines + 0.5), dpi=130, layout="constrained")
        panels = np.atleast_1d(figure.subplots(lines, columns)).ravel()
        limits = _limits(outcomes)
        for number, (panel, found) in enumerate(zip(panels, shown, strict=False)):
            is_right = number % columns == columns - 1 or found is shown[-1]
            _draw(panel, found, outcomes.unspoilt, limits, number % columns == 0, is_right)
        for panel in panels[len(shown) :]:
            panel.set_axis_off()
        _draw_legend(panels[len(shown)])
        figure.suptitle(f"{Path(outcomes.source).name}, spoilt", x=0.01, ha="left", fontsize=13, fontweight="bold")
        figure.savefig(path)


def _limits(outcomes: Outcomes) -> tuple[float, float]:
    """Return the limits of the ATE (mm) in all panels."""
    verdicts = [outcomes.unspoilt, *(verdict for found in outcomes.axes for _, verdict in found.verdicts)]
    found = [1e3 * verdict.ate_m for verdict in verdicts if verdict.ate_m]
    return (min(found) / _ROOM, max(found) * _ROOM) if found else (1.0, 10.0)


def _draw(
    panel: "Axes", found: AxisOutcome, unspoilt: Verdict, limits: tuple[float, float], is_left: bool, is_right: bool
) -> None:
    labels = ["none", *(level.label for level, _ in found.verdicts)]
    verdicts = [unspoilt, *(verdict for _, verdict in found.verdicts)]
    x = np.arange(len(verdicts))
    shares = panel.twinx()
    _draw_shares(shares, x, verdicts)
    shares.set_yticks([0, 50, 100], ["0", "50", "100 %"] if is_right else [])
    panel.set_zorder(shares.get_zorder() + 1)
    panel.patch.set_visible(False)
    ate = [np.nan if verdict.ate_m is None else 1e3 * verdict.ate_m for verdict in verdicts]
    panel.plot(x, ate, "o-", color=INK, lw=1.6, ms=5)
    partial = [value if is_partial(verdict, unspoilt) else np.nan for value, verdict in zip(ate, verdicts, strict=True)]
    panel.plot(x, partial, "o", color=INK, mfc="white", ms=5)
    if unspoilt.ate_m:
        panel.axhline(2e3 * unspoilt.ate_m, color=INK, lw=0.8, ls=(0, (4, 3)))
    panel.set(
        title=fill(found.axis.title, _TITLE, break_on_hyphens=False),
        yscale="log",
        ylim=limits,
        xlim=(-0.6, len(x) - 0.4),
    )
    number_plainly(panel.yaxis)
    panel.set_xticks(x, [label.replace(" ", "\n", 1) for label in labels])
    if is_left:
        panel.set_ylabel("ATE, mm")


def _draw_shares(panel: "Axes", x: np.ndarray, verdicts: Sequence[Verdict]) -> None:
    """Draw a bar of 100 % a run, from the bottom: wrong, tracked, UNCERTAIN, LOST; a failed run has none."""
    bottom = np.zeros(len(x))
    ran = np.array([not verdict.error for verdict in verdicts])
    parts = {
        WRONG: [verdict.wrong for verdict in verdicts],
        TRACKED: [verdict.tracked - verdict.wrong for verdict in verdicts],
        UNCERTAIN: [1.0 - verdict.tracked - verdict.lost for verdict in verdicts],
        LOST: [verdict.lost for verdict in verdicts],
    }
    for color, part in parts.items():
        height = 100.0 * np.where(ran, part, 0.0)
        panel.bar(x, height, bottom=bottom, width=0.8, color=color, lw=0)
        bottom = bottom + height
    panel.set_ylim(0, 100)


def _draw_legend(panel: "Axes") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color=INK, marker="o", ms=5, lw=1.6, label="ATE (left)"),
        Line2D(
            [],
            [],
            color=INK,
            marker="o",
            mfc="white",
            ms=5,
            lw=0,
            label="ATE over less than half of the unspoilt one's frames",
        ),
        Line2D([], [], color=INK, lw=0.8, ls=(0, (4, 3)), label="twice the unspoilt ATE"),
        *(Patch(color=color, label=name) for color, name in _NAMES.items()),
    ]
    panel.legend(handles=handles, loc="center", title="bars: share of frames (right)")
