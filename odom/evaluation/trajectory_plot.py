"""`plot.png`: a trajectory against truth on one sheet, readable in print and by the colour-blind."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from odom.evaluation.metrics import rmse
from odom.evaluation.report import Report
from odom.evaluation.times import Stamps
from odom.geometry.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


TRUTH, FINAL, ONLINE, BAND = "#1a1a1a", "#0072B2", "#D55E00", "#56B4E9"
"""Colours of M. Okabe and K. Ito's palette; each line also differs in width and dashes."""

_DASHES = (0, (3, 1.4))
"""Length of a dash and of the gap after it, in line widths."""
_CLEARLY_UP = 0.7
"""Cosine between the camera's mean up direction and the world axis that counts as up: below it, none does."""
_HOLE_PERIODS = 5
"""A line is interrupted where samples are missing for longer than so many periods."""

_SHEET = {"left": 0.07, "right": 0.99, "top": 0.918, "bottom": 0.063, "wspace": 0.138, "hspace": 1.6}
"""Where the axes stand, as shares of the sheet: a layout that measures all texts first takes as long as the drawing."""
_REMARKS, _REMARK = 0.012, 0.018
"""Height of the remarks below the axes, as a share of the sheet: the space above them, and each line."""

_TITLE = 52
"""Characters of a title: of a longer one the middle is left out, so that what was judged can be read beside it."""
_ABOVE = 1.25
"""Height of an axis over its largest value: the legend stands between them."""
_USUAL = 99.8
"""Per cent of the errors over which the histogram reaches: the last bar holds those beyond, too."""

_COMPRESSION = 2
"""Of a .png: more takes longer than the drawing itself and saves a fifth of the file."""

_STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": False, "figure.autolayout": False,  # whatever else has set them: see _SHEET
    "font.family": "DejaVu Sans", "font.size": 9.5,
    "axes.titlesize": 10.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "axes.titley": 1.0,  # a fixed place: searching for the best one would choose the same
    "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#666666", "axes.linewidth": 0.8,
    "axes.grid": True, "axes.axisbelow": True, "grid.color": "#e4e4e4", "grid.linewidth": 0.7,
    "text.parse_math": False, "legend.frameon": False, "xtick.color": "#444444", "ytick.color": "#444444",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ClaimedError:
    """Errors (m) of translations over a second that end at `stamps` (ns), and the 3-sigma bound claimed of them (m)."""

    stamps: Stamps
    errors_m: Array
    three_sigma_m: Array


def load_drawing() -> None:
    """Import what `plot` needs: callers can do so ahead, as it takes half a second.

    Matplotlib would take a quarter of that to write documentation of its own classes, which is left out.
    """
    from matplotlib import artist as artists

    documentation, artists.kwdoc = artists.kwdoc, lambda artist: ""
    try:
        for name in ("matplotlib.backends.backend_agg", "matplotlib.figure", "matplotlib.font_manager"):
            import_module(name)
    finally:
        artists.kwdoc = documentation


def plot(
    path: Path,
    final: Report,
    online: Report | None = None,
    claimed: ClaimedError | None = None,
    title: str = "",
    remarks: Sequence[str] = (),
) -> None:
    """Draw the matched trajectories from above and from the side, errors over time and their histogram.

    `online` is the causal estimate, `claimed` the bound its covariance promises. Up is the world's axis nearest to the
    camera's own up direction on average: motion capture has y up, most others z. Time counts from the first of all that
    is drawn.
    """
    R_drawn_world = _upright(final.truth.T_world_body)
    final, online = _turned(final, R_drawn_world), _turned(online, R_drawn_world) if online else None
    load_drawing()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(11.7, 8.3), dpi=150)
        bottom = _SHEET["bottom"] + (_REMARKS if remarks else 0.0) + _REMARK * len(remarks)
        grid = figure.add_gridspec(6, 2, width_ratios=(1.0, 1.15), **(_SHEET | {"bottom": bottom}))
        _draw_views(figure.add_subplot(grid[:3, 0]), figure.add_subplot(grid[3:, 0]), final, online)
        rows = (slice(0, 2), slice(2, 4), slice(4, 6)) if claimed else (slice(0, 3), None, slice(3, 6))
        starts = [report.truth.stamps[0] for report in (final, online) if report]
        begin = min([*starts, claimed.stamps[0]] if claimed else starts)
        _draw_error(figure.add_subplot(grid[rows[0], 1]), begin, final, online)
        if claimed and rows[1]:
            _draw_claimed(figure.add_subplot(grid[rows[1], 1]), begin, claimed)
        _draw_histogram(figure.add_subplot(grid[rows[2], 1]), final, online)
        figure.suptitle(
            (f"{_shortened(title)}   " if title else "") + f"{final.matched} of {final.total} frames judged",
            x=0.012, y=0.988, ha="left", fontsize=13, fontweight="bold",
        )  # fmt: skip
        if remarks:
            figure.supxlabel("\n".join(remarks), x=0.012, ha="left", fontsize=8.5, color="#444444")
        figure.savefig(path, pil_kwargs={"compress_level": _COMPRESSION} if path.suffix == ".png" else None)


def _upright(T_world_camera: Array) -> Array:
    """Return the rotation (4 x 4) that brings the world's up axis to z, the identity when it cannot be told."""
    up = -T_world_camera[:, :3, 1].mean(axis=0)
    axis = int(np.argmax(np.abs(up)))
    T = np.eye(4)
    if axis != 2 and abs(up[axis]) > _CLEARLY_UP:
        z = np.zeros(3)
        z[axis] = np.sign(up[axis])
        x = np.roll(np.abs(z), 1)
        T[:3, :3] = np.stack([x, np.cross(z, x), z])
    return T


def _turned(report: Report, T_drawn_world: Array) -> Report:
    return replace(
        report,
        truth=report.truth.moved(T_drawn_world),
        estimate_aligned=report.estimate_aligned.moved(T_drawn_world),
    )


def _shortened(title: str) -> str:
    return title if len(title) <= _TITLE else f"{title[: _TITLE // 2]}…{title[-_TITLE // 2 :]}"


def _seconds(stamps: Stamps, begin: int) -> Array:
    return np.asarray((stamps - begin) * 1e-9)


def _gaps_opened(seconds: Array, values: Array) -> tuple[Array, Array]:
    """Return the curve with NaN put where samples are missing, so that no line bridges a hole."""
    steps = np.diff(seconds)
    holes = np.flatnonzero(steps > _HOLE_PERIODS * np.median(steps)) + 1 if len(steps) else np.zeros(0, dtype=np.intp)
    return np.asarray(np.insert(seconds, holes, np.nan)), np.asarray(np.insert(values, holes, np.nan, axis=0))


def _draw_views(above: "Axes", side: "Axes", final: Report, online: Report | None) -> None:
    """Draw the paths along their main horizontal direction: from above, and from the side."""
    truth = final.truth.positions
    centre = truth.mean(axis=0)
    along = np.linalg.svd(truth[:, :2] - centre[:2], full_matrices=False)[2][0]
    x, y = along * np.sign(along[np.argmax(np.abs(along))])
    R_view_world = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    curves: list[tuple[Report, Array, dict[str, Any]]] = [
        (final, truth, {"color": TRUTH, "lw": 3.2, "alpha": 0.30, "label": "truth"}),
        (final, final.estimate_aligned.positions, {"color": FINAL, "lw": 1.8, "label": _name(online)}),
    ]
    if online:
        style: dict[str, Any] = {"color": ONLINE, "lw": 1.0, "ls": (0, (3, 2.5)), "label": "online"}
        curves.append((online, online.estimate_aligned.positions, style))
    views = ((above, 1, "From above", "across, m"), (side, 2, "From the side", "height, m"))
    for axis, row, title, name in views:
        for report, points, look in curves:
            curve = ((points - centre) @ R_view_world.T)[:, [0, row]]
            axis.plot(*_gaps_opened(_seconds(report.truth.stamps, 0), curve)[1].T, **look, solid_capstyle="round")
        start = (R_view_world @ (truth[0] - centre))[[0, row]]
        axis.plot(*start, "o", ms=7, mfc="white", mec=TRUTH, mew=1.5, label="start", zorder=5)
        axis.set_aspect("equal", adjustable="datalim")
        axis.set(title=title, xlabel="along the main direction, m", ylabel=name)
    above.legend(loc="best", ncols=2, handlelength=2.4)


def _draw_error(axis: "Axes", begin: int, final: Report, online: Report | None) -> None:
    if online:
        curve = _gaps_opened(_seconds(online.truth.stamps, begin), 1e3 * online.errors_m)
        axis.plot(*curve, color=ONLINE, lw=1.0, ls=_DASHES, label=f"online, ATE {1e3 * online.ate_m:.1f} mm")
    label = f"{_name(online)}, ATE {1e3 * final.ate_m:.1f} mm"
    curve = _gaps_opened(_seconds(final.truth.stamps, begin), 1e3 * final.errors_m)
    axis.plot(*curve, color=FINAL, lw=1.4, label=label)
    axis.set_ylim(0, _ABOVE * 1e3 * max(float(report.errors_m.max()) for report in (final, online) if report) or None)
    axis.margins(x=0.01)
    axis.set(title="Distance from truth after alignment", xlabel="time, s", ylabel="mm")
    axis.legend(loc="upper right", ncols=2)


def _draw_claimed(axis: "Axes", begin: int, claimed: ClaimedError) -> None:
    seconds = _seconds(claimed.stamps, begin)
    seconds, both = _gaps_opened(seconds, np.column_stack([claimed.errors_m, claimed.three_sigma_m]) * 1e3)
    share = float(np.mean(claimed.errors_m <= claimed.three_sigma_m))
    axis.fill_between(seconds, 0, both[:, 1], color=BAND, alpha=0.35, lw=0, label="claimed 3 sigma")
    axis.plot(seconds, both[:, 1], color=BAND, lw=0.8)
    axis.plot(seconds, both[:, 0], color=TRUTH, lw=1.0, label=f"error over 1 s, {share:.1%} inside")
    axis.set_ylim(0, _ABOVE * float(np.nanpercentile(both, 99.5)))
    axis.margins(x=0.01)
    axis.set(title="Drift over one second against the claimed 3 sigma", xlabel="time, s", ylabel="mm")
    axis.legend(loc="upper right", ncols=2)


def _draw_histogram(axis: "Axes", final: Report, online: Report | None) -> None:
    errors = [1e3 * report.errors_m for report in (final, online) if report]
    bins = np.linspace(0, max(float(np.percentile(e, _USUAL)) for e in errors), 41).tolist()
    held = [np.minimum(e, bins[-1]) for e in errors]
    if online:
        axis.hist(held[1], bins=bins, histtype="step", color=ONLINE, lw=1.3, ls=_DASHES, label="online")
    axis.hist(held[0], bins=bins, histtype="stepfilled", color=FINAL, alpha=0.75, label=_name(online))
    for value, name in ((float(np.median(errors[0])), "median"), (rmse(errors[0]), "RMSE")):
        axis.axvline(value, color=TRUTH, lw=1.0, ls="-" if name == "RMSE" else ":", label=f"{name} {value:.1f} mm")
    axis.set(title="How often how far", xlabel="distance from truth, mm", ylabel="frames")
    axis.legend(loc="upper right")


def _name(online: Report | None) -> str:
    """Return the name of the final estimate: corrected, where there is an online one too."""
    return "corrected" if online else "estimate"
