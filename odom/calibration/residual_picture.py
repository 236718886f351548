"""A picture of the residuals over the image and over range, before and after a calibration."""

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from odom.calibration.adjustment import Fit
from odom.calibration.linearised import chi_squared, linearised
from odom.calibration.parameters import LENS
from odom.calibration.result import Judgement
from odom.calibration.survey import Survey
from odom.evaluation.log_axis import number_plainly
from odom.geometry.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CELLS = (16, 12)
"""Cells of the image, across and down, whose residuals are averaged."""
_LEAST = 8
"""Observations of a cell or range that is drawn: fewer show noise."""
_RANGES_M = np.geomspace(0.4, 6.0, 13)
"""Bounds of the ranges of depth over which means are drawn, each a quarter farther than the last."""
_TITLE = 100
"""Characters of a line of the title, which is as wide as the sheet then."""
_MOST_CHI2 = 25.0
"""Beyond it an observation is a wrong match, and left out."""
_BEFORE, _AFTER = "#D55E00", "#0072B2"
"""Colours of M. Okabe and K. Ito's palette."""


def draw(path: Path, survey: Survey, judgement: Judgement, title: str) -> None:
    """Write the picture: arrows are mean residuals of corners, colours mean errors of depth."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8.5), dpi=120, layout="constrained")
    figure.suptitle(fill(title, _TITLE), x=0.01, ha="left", parse_math=False)
    grid = figure.subplots(2, 2)
    found = [_residuals(survey, fit) for fit in judgement.fits]
    for axis, (uv, px, mm, _), words in zip(grid[0], found, ("as it was", "calibrated"), strict=True):
        _draw_field(figure, axis, (survey.camera.width, survey.camera.height), uv, px, mm)
        axis.set_title(f"{words}: corners (arrows, 1 px = 40 px), depth (colour)")
    for (_, px, mm, metres), colour, words in zip(found, (_BEFORE, _AFTER), ("as it was", "calibrated"), strict=True):
        which = np.digitize(metres, _RANGES_M)
        mean = [_mean(mm[which == k]) for k in range(1, len(_RANGES_M))]
        middle = np.sqrt(_RANGES_M[:-1] * _RANGES_M[1:])
        grid[1, 0].plot(middle, mean, "o-", color=colour, label=words)
        size = np.linalg.norm(px, axis=1)
        grid[1, 1].plot(np.sort(size), np.linspace(0, 1, len(size)), color=colour, label=words)
    grid[1, 0].set(xscale="log", xlabel="range (m)", ylabel="mean error of depth (mm)", title="Depth over range")
    grid[1, 0].set_xlim(_RANGES_M[0], _RANGES_M[-1])
    number_plainly(grid[1, 0].xaxis)
    grid[1, 1].set(xlim=(0, 3), xlabel="residual of a corner (px)", ylabel="share below", title="Corners")
    for axis in grid[1]:
        axis.grid(color="#e4e4e4")
        axis.legend(frameon=False)
    figure.savefig(path)


def _residuals(survey: Survey, fit: Fit) -> tuple[Array, Array, Array, Array]:
    """Return pixels (n x 2), residuals (n x 2, px), errors of depth (n, mm, NaN: none) and range (n, m)."""
    lines = linearised(survey, fit.vector, fit.bundle)
    ray, depth = chi_squared(lines)
    good = (ray < _MOST_CHI2) & ~(depth > _MOST_CHI2)
    metres = 1.0 / lines.predicted[good, 2]
    px = lines.residuals[good, :2] * fit.vector[LENS][:2]
    return survey.uv[good], px, -1e3 * lines.residuals[good, 2] * metres**2, metres


def _draw_field(figure: Any, axis: "Axes", size: tuple[int, int], uv: Array, px: Array, mm: Array) -> None:
    width, height = size
    column = np.clip((uv[:, 0] / width * _CELLS[0]).astype(int), 0, _CELLS[0] - 1)
    row = np.clip((uv[:, 1] / height * _CELLS[1]).astype(int), 0, _CELLS[1] - 1)
    arrows, error = np.full((_CELLS[1], _CELLS[0], 2), np.nan), np.full((_CELLS[1], _CELLS[0]), np.nan)
    for i in range(_CELLS[1]):
        for j in range(_CELLS[0]):
            here = (row == i) & (column == j)
            if here.sum() >= _LEAST:
                arrows[i, j] = np.mean(px[here], axis=0)
                error[i, j] = _mean(mm[here])
    shown = axis.imshow(error, extent=(0, width, height, 0), cmap="RdBu", vmin=-10, vmax=10, alpha=0.7)
    figure.colorbar(shown, ax=axis, label="mm", shrink=0.7)
    u, v = (np.arange(_CELLS[0]) + 0.5) * width / _CELLS[0], (np.arange(_CELLS[1]) + 0.5) * height / _CELLS[1]
    arrow: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1 / 40, "width": 0.003}
    axis.quiver(u, v, arrows[:, :, 0], arrows[:, :, 1], **arrow)


def _mean(values: Array) -> float:
    """Return the mean of what was measured, NaN of too little."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) >= _LEAST else np.nan
