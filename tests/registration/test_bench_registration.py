"""The command, as a user runs it; and what it says of cost."""

import json
import subprocess
import sys

import numpy as np
import pytest

from odom.evaluation.paper.benchmark import PAPER_MM
from odom.evaluation.paper.cost import costs, growth


def test_bench_registration_prints_and_saves_table_and_plot(tmp_path):
    table, plot = tmp_path / "table.json", tmp_path / "table.png"
    command = [sys.executable, "-m", "odom", "bench", "registration", "--clouds", "2"]
    run = subprocess.run([*command, "--json", table, "--plot", plot], capture_output=True, text=True, timeout=280)
    assert run.returncode == 0, run.stderr
    found = json.loads(table.read_text())
    names = {row["estimator"] for row in found["rows"] if row["group"] == "paper"}
    assert names == {"EM-ICP", "WICP", "Horn", "RF", "KF"}
    assert {row["group"] for row in found["rows"]} == {"paper", "told wrongly", "no correspondences", "wrong pairs"}
    for row in found["rows"]:
        assert row["time_ms"] > 0.0
        assert row["clouds"] == 2
    printed = {row["paper_mm"] for row in found["rows"]} - {None}
    assert printed == {figure for row in PAPER_MM.values() for figure in row.values()}
    assert max(cost["pairs"] for cost in found["costs"]) == 100_000
    assert plot.stat().st_size > 20_000
    for word in ("bound", "NEES", "Horn / SVD in numpy", "95 % wrong"):
        assert word in run.stdout


def test_bench_refuses_no_clouds():
    command = [sys.executable, "-m", "odom", "bench", "registration", "--clouds", "0"]
    assert subprocess.run(command, capture_output=True, timeout=60, check=False).returncode == 2


@pytest.mark.alone
def test_cost_is_within_its_bars():
    found = {cost.what: cost for cost in costs()}
    assert found["RF, diagonal covariances of the target"].ratio_to_horn <= 1.0
    assert found["RF, full covariances of both clouds"].ratio_to_horn <= 4.0
    assert found["gate + RF, full covariances, 30 % wrong"].ratio_to_horn <= 1.5 / 0.09


@pytest.mark.alone
def test_cost_is_linear_in_the_number_of_pairs():
    for what in ("RF", "gate + RF, 30 % wrong"):
        chosen = [cost for cost in growth((1000, 10_000, 100_000)) if cost.what == what]
        slope = np.polyfit(np.log([c.pairs for c in chosen]), np.log([c.time_ms for c in chosen]), 1)[0]
        assert slope < 1.35
