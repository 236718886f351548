"""Figure 1 of the paper: uncertainty of points, scene and walk, RMSE and time of the five estimators."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from odom.evaluation.paper.figure import COLOURS
from odom.evaluation.physical.judging import NAMES
from odom.evaluation.physical.table import Row
from odom.geometry.arrays import Array, Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {"kinect2": "newer Kinect (time of flight)", "kinect1": "older Kinect (structured light)", "": "recording"}
"""What the sensors are called in tables and pictures."""
_PLANES = (("z", "x", 2, 0), ("z", "y", 2, 1), ("y", "x", 1, 0))
"""The three projections of the paper's Figure 1 a: names and numbers of the axes across and up."""
_TURN = np.linspace(0.0, 2.0 * np.pi, 90)
"""Angles (rad) at which the outline of an ellipse is drawn."""


def plot(
    table: Sequence[Row],
    ellipsoids: Mapping[str, Any],
    scene: Image | None,
    walks: Mapping[str, Array],
    path: Path,
) -> None:
    """Write the picture to `path`.

    `ellipsoids` see `read_ellipsoids` (empty: not drawn), `scene` is an RGB image, `walks` the camera's true positions
    (n x 3, m) by sensor.
    """
    from matplotlib.figure import Figure

    sensors = list(dict.fromkeys(row.sensor for row in table))
    figure = Figure(figsize=(14.0, 13.0), layout="constrained")
    halves = figure.subfigures(2, 1, squeeze=False, height_ratios=(1.0, 2.3))
    top, below = halves[0, 0], halves[1, 0]
    first = top.subplots(1, 5, width_ratios=(1.0, 1.0, 1.0, 1.5, 1.2))
    for axes, plane in zip(first[:3], _PLANES, strict=True):
        _draw_ellipsoids(axes, ellipsoids, plane)
    first[0].set_title("(a) 1 sigma of two points, by Z-levels (axes differ in scale)", loc="left", fontsize=10)
    top.legend(*first[0].get_legend_handles_labels(), ncols=4, fontsize=8, loc="outside lower left")
    _draw_scene(first[3], first[4], scene, walks)
    grid = below.subplots(2, len(sensors), squeeze=False, sharex="col")
    for column, sensor in enumerate(sensors):
        mine = [row for row in table if row.sensor == sensor]
        _draw_rmse(grid[0][column], mine, f"({'cd'[column]}) RMSE, {TITLES.get(sensor, sensor)}")
        _draw_time(grid[1][column], mine, f"({'ef'[column]}) time a registration")
    below.legend(*grid[0][0].get_legend_handles_labels(), ncols=8, fontsize=8, loc="outside upper center")
    figure.savefig(path, dpi=90)


def _draw_ellipsoids(axes: "Axes", ellipsoids: Mapping[str, Any], plane: tuple[str, str, int, int]) -> None:
    """Draw the 1-sigma ellipses of both points about their own middles, in mm."""
    across, up, i, j = plane
    for name, color in (("near", "#0072b2"), ("far", "#d55e00")):
        shown = ellipsoids.get(name)
        if shown is None:
            continue
        for which, style in (("z_levels", "-"), ("in_use", ":")):
            C = 1e6 * np.array(shown[which])[np.ix_((i, j), (i, j))]
            values, vectors = np.linalg.eigh(C)
            ring = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * [np.cos(_TURN), np.sin(_TURN)])
            label = f"{name}, {shown['point_m'][2]:.1f} m" if which == "z_levels" else f"{name}, noise in use"
            axes.plot(*ring, style, color=color, label=label)
    axes.set_xlabel(f"{across}, mm")
    axes.set_ylabel(f"{up}, mm")
    axes.grid(alpha=0.3)


def _draw_scene(picture: "Axes", plan: "Axes", scene: Image | None, walks: Mapping[str, Array]) -> None:
    picture.set_axis_off()
    picture.set_title("(b) scene, and the walk by truth", loc="left", fontsize=10)
    if scene is not None:
        picture.imshow(scene)
    for sensor, walk in walks.items():
        if len(walk):
            spread = np.ptp(walk, axis=0)
            i, j = sorted(np.argsort(-spread, kind="stable")[:2])
            plan.plot(walk[:, i], walk[:, j], ".-", markersize=3, linewidth=0.8, label=TITLES.get(sensor, sensor))
            plan.plot(*walk[0, [i, j]], "o", color="black", markersize=5)
    plan.set_aspect("equal", adjustable="datalim")
    plan.set_xlabel("m")
    plan.grid(alpha=0.3)


def _places(table: Sequence[Row]) -> dict[tuple[str, bool, str], float]:
    """Return where each row stands: front-ends in groups, in each first ungated, then gated estimators."""
    front_ends = list(dict.fromkeys(row.front_end for row in table))
    return {
        (front_end, is_gated, name): 14.0 * g + 6.0 * is_gated + k
        for g, front_end in enumerate(front_ends)
        for is_gated in (False, True)
        for k, name in enumerate(NAMES)
    }


def _draw_rmse(axes: "Axes", table: Sequence[Row], title: str) -> None:
    places = _places(table)
    for row in table:
        x = places[row.front_end, row.is_gated, row.estimator]
        if np.isfinite(row.rmse_mm):
            error = np.abs(np.array([[row.rmse_mm - row.low_mm], [row.high_mm - row.rmse_mm]]))
            axes.errorbar(
                x, row.rmse_mm, error if np.isfinite(error).all() else None, fmt="o", color=COLOURS[row.estimator],
                markerfacecolor=COLOURS[row.estimator] if row.is_gated else "white", capsize=3,
            )  # fmt: skip
        if row.paper_mm is not None and not row.is_gated:
            axes.plot(x, row.paper_mm, "x", color=COLOURS[row.estimator], alpha=0.6)
    for name in NAMES:
        axes.plot([], [], "o", color=COLOURS[name], label=name)
    axes.plot([], [], "o", color="grey", markerfacecolor="white", label="without the gate")
    axes.plot([], [], "o", color="grey", label="behind the gate")
    axes.plot([], [], "x", color="grey", label="printed in the paper")
    axes.set_ylabel("RMSE to truth, mm, with 95 % interval")
    _finish(axes, table, title)


def _draw_time(axes: "Axes", table: Sequence[Row], title: str) -> None:
    places = _places(table)
    for row in table:
        face = COLOURS[row.estimator] if row.is_gated else "white"
        place = places[row.front_end, row.is_gated, row.estimator]
        axes.plot(place, row.time_ms, "o", color=COLOURS[row.estimator], markerfacecolor=face)
    axes.set_ylabel("CPU, ms (median)")
    _finish(axes, table, title)


def _finish(axes: "Axes", table: Sequence[Row], title: str) -> None:
    front_ends = list(dict.fromkeys(row.front_end for row in table))
    shares = {row.front_end: row for row in table}
    labels = [f"{name}\n{shares[name].pairs:.0f} pairs, {100 * shares[name].wrong:.0f} % wrong" for name in front_ends]
    axes.set_xticks([14.0 * g + 5.0 for g in range(len(front_ends))], labels)
    axes.set_yscale("log")
    axes.grid(axis="y", alpha=0.3)
    axes.set_title(title, loc="left", fontsize=10)
