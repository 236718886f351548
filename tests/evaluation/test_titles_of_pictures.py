"""Titles can be read whole, however long a name is, and whatever signs are in it."""

import numpy as np
import pytest
from sheets import cut, on_each_other, sheets_drawn
from synthetic import odometry, smooth, trajectory

from odom.evaluation import evaluate
from odom.evaluation.robustness import figure
from odom.evaluation.robustness.axes import AXES
from odom.evaluation.robustness.outcomes import AxisOutcome, Outcomes
from odom.evaluation.robustness.verdict import Verdict
from odom.evaluation.trajectory_plot import plot

LONG = "2026-11-30_14-05_kinect-v1_" + "second-floor_laboratory_and_corridor_" * 4 + "run-03.txt"


@pytest.mark.parametrize("shown", [AXES, [axis for axis in AXES if axis.name == "people-who-rest"]])
def test_every_axis_of_the_robustness_bench_has_a_title_that_can_be_read(tmp_path, monkeypatch, shown):
    drawn = sheets_drawn(monkeypatch)
    verdict = Verdict(frames=300, ate_m=0.01, ate_share=1.0, tracked=0.9, judged=300)
    axes = tuple(AxisOutcome(axis, tuple((level, verdict) for level in axis.levels)) for axis in shown)
    figure.plot(Outcomes("fr1", 0, verdict, axes, 1.0, 1.0), tmp_path / "robustness.png")
    titles = {axis.title for axis in shown}
    assert titles <= {panel.get_title(loc="left").replace("\n", " ") for panel in drawn[0].axes}
    assert not [text for text in cut(drawn[0]) if text.replace("\n", " ") in titles]
    both = [{one.replace("\n", " "), other.replace("\n", " ")} for one, other in on_each_other(drawn[0])]
    assert not [pair for pair in both if len(pair & titles) == 2]


@pytest.mark.parametrize("name", [LONG, "walk_$1_{$2.txt", "trajectory.txt"])
def test_the_plot_of_a_file_says_how_much_was_judged(tmp_path, monkeypatch, name):
    drawn = sheets_drawn(monkeypatch)
    rng = np.random.default_rng(0)
    true = trajectory(smooth(rng), np.arange(0, 5, 1 / 30))
    plot(tmp_path / "plot.png", evaluate(odometry(rng, true), true), title=name)
    assert drawn[0].get_suptitle().endswith("150 of 150 frames judged")
    assert drawn[0].get_suptitle().startswith(name[:20].partition(".txt")[0])
    assert not cut(drawn[0])
