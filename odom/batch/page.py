"""The page of a batch: one file with plots and table, to be opened in a browser."""

import io
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from odom.batch.summary import DONE, JUDGED, Row
from odom.evaluation.log_axis import ONE_TWO_FIVE, number_plainly

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PLOTTED = {
    "ate_m": ("ATE, m", True),
    "rpe_1s_m": ("drift over 1 s, m", True),
    "completeness": ("share of frames tracked", False),
    "nees_mean": ("NEES over 1 s (6 is honest)", True),
}
"""Figures of the plots: their title, and whether the axis is logarithmic."""
_ROW_IN, _HEAD_IN, _TALLEST_IN = 0.2, 1.1, 100.0
"""Inches a recording, of the titles, and of the whole picture at the most."""
_MOST_NAMED = 500
"""Recordings whose names stand beside the picture: those of more would lie on each other."""
_ROOM, _WIDE = 1.6, 30.0
"""Space on a logarithmic axis beyond the least and the largest value, a factor, so that there is a number on it; and
the ratio of its ends from which there are numbers at powers of ten alone."""
_DRAWN: dict[Any, Any] = {
    "svg.hashsalt": "odom",
    "svg.fonttype": "none",
    "font.size": 8,
    "text.parse_math": False,
}
_STYLE = """
body { font: 14px/1.5 sans-serif; margin: 2em; color: #222 } table { border-collapse: collapse }
td, th { padding: .2em .7em; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap }
td:first-child, th:first-child, td:nth-child(2), td:nth-child(3) { text-align: left }
td:nth-child(2), td:nth-child(3) { max-width: 30em; white-space: normal }
.better { color: #0a7d32 } .worse { color: #c0232c } svg { max-width: 100%; height: auto }
"""


def page(rows: Sequence[Row], totals: Mapping[str, Any]) -> str:
    """Return the page, the same bytes for the same rows; names lead to the folders of results beside it."""
    words = ", ".join(f"{name.replace('_', ' ')} {_text(value)}" for name, value in totals.items())
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>odom batch</title>'
        f"<style>{_STYLE}</style></head>\n<body><h1>{totals['done']} of {totals['recordings']} recordings</h1>"
        f"<p>{escape(words)}</p>\n{_plots(rows)}\n{_table(rows)}</body></html>\n"
    )


def _table(rows: Sequence[Row]) -> str:
    names = [name for name in rows[0] if name not in ("content", "key")] if rows else []
    head = "".join(f"<th>{escape(name.replace('_', ' '))}</th>" for name in names)
    lines = [f"<table><thead><tr>{head}</tr></thead><tbody>"]
    for row in rows:
        cells = "".join(f"<td>{_cell(row, name)}</td>" for name in names)
        lines.append(f'<tr class="{row["change"]}">{cells}</tr>')
    return "\n".join([*lines, "</tbody></table>"])


def _cell(row: Row, name: str) -> str:
    text = escape(_text(row[name]))
    return f'<a href="results/{row["key"]}/">{text}</a>' if name == "name" and row["state"] == DONE else text


def _text(value: object) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def _plots(rows: Sequence[Row]) -> str:
    """Return an SVG with a column for each figure, and above it a sentence on its dots and rings."""
    shown = {name: how for name, how in _PLOTTED.items() if any(row[name] is not None for row in rows)}
    if not shown:
        return ""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_DRAWN):
        height = min(_HEAD_IN + _ROW_IN * len(rows), _TALLEST_IN)
        figure = Figure(figsize=(12, height), layout="constrained")
        axes = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
        places = range(len(rows))
        for axis, (name, (title, is_logarithmic)) in zip(axes, shown.items(), strict=True):
            now, before = [_number(row[name]) for row in rows], []
            if name in JUDGED and _has_baseline(rows):
                before = [_number(row[f"baseline_{name}"]) for row in rows]
                axis.plot(before, places, "o", mfc="none", color="#888", ms=6)
            axis.plot(now, places, "o", color="#1a5fb4", ms=4)
            axis.set_title(title)
            axis.grid(alpha=0.3)
            if is_logarithmic and any(value > 0 for value in now):
                _logarithmic(axis, [value for value in (*now, *before) if value > 0])
        axes[0].set_yticks(*((places, [row["name"] for row in rows]) if len(rows) <= _MOST_NAMED else ([],)))
        axes[0].set_ylim(len(rows), -1)
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    return f"<p>{_legend(rows)}</p>\n<svg" + drawn.getvalue().partition("<svg")[2]


def _legend(rows: Sequence[Row]) -> str:
    named = "" if len(rows) <= _MOST_NAMED else ", from above in the order of the table"
    return f"Dots: a recording each{named}.{' Rings: the baseline.' if _has_baseline(rows) else ''}"


def _has_baseline(rows: Sequence[Row]) -> bool:
    return any(f"baseline_{name}" in row for row in rows for name in JUDGED)


def _logarithmic(axis: "Axes", values: Sequence[float]) -> None:
    """Make the axis of positive values logarithmic, with numbers that do not lie on each other."""
    low, high = min(values) / _ROOM, max(values) * _ROOM
    axis.set(xscale="log", xlim=(low, high))
    number_plainly(axis.xaxis, ONE_TWO_FIVE if high < _WIDE * low else (1.0,))


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
