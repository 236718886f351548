"""Figure 2 of the paper, with the bound: RMSE and time per sample on logarithmic axes."""

from pathlib import Path

import numpy as np

from odom.evaluation.paper.benchmark import ESTIMATORS, Row

COLOURS = {"EM-ICP": "#cc79a7", "WICP": "#009e73", "Horn": "#d55e00", "RF": "#000000", "KF": "#0072b2"}
"""The paper's colours, in a palette that colour-blind people can tell apart."""


def plot(table: list[Row], path: Path) -> None:
    """Write the picture of the paper's scenarios to `path`: RMSE above, with the bound; time per registration below."""
    from matplotlib.figure import Figure

    scenarios = list(dict.fromkeys(row.scenario for row in table if row.group == "paper"))
    where = {name: i for i, name in enumerate(scenarios)}
    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for offset, name in zip(np.linspace(-0.3, 0.3, len(ESTIMATORS)), ESTIMATORS, strict=True):
        chosen = [row for row in table if row.group == "paper" and row.estimator == name]
        x = np.array([where[row.scenario] for row in chosen]) + offset
        above.plot(x, [row.rmse_mm for row in chosen], "o", color=COLOURS[name], label=name)
        below.plot(x, [row.time_ms for row in chosen], "o", color=COLOURS[name])
        printed = [(x[i], row.paper_mm) for i, row in enumerate(chosen) if row.paper_mm is not None]
        above.plot(*zip(*printed, strict=True), "x", color=COLOURS[name], alpha=0.6, markersize=5)
    bounds = {row.scenario: row.bound_mm for row in table if row.group == "paper"}
    for name, bound in bounds.items():
        above.hlines(bound, where[name] - 0.4, where[name] + 0.4, color="grey", linewidth=2.5, zorder=0)
    above.plot([], [], "x", color="grey", label="printed in the paper")
    above.plot([], [], color="grey", linewidth=2.5, label="Cramer-Rao bound")
    above.set_ylabel("RMSE to noise-free targets, mm")
    below.set_ylabel("time a registration, ms")
    for axes in (above, below):
        axes.set_yscale("log")
        axes.grid(axis="y", alpha=0.3)
    below.set_xticks(range(len(scenarios)), scenarios, rotation=55, ha="right", fontsize=8)
    above.legend(ncols=7, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, 1.1))
    figure.savefig(path, dpi=130)
