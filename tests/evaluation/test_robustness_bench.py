"""The robustness bench as a whole: its table, and its command on a few seconds of a small recording."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from odom.bench import robustness_bench
from odom.bench.bench_child import ChildResult
from odom.bench.robustness_bench import chosen_axes, measure_robustness
from odom.bench.robustness_run import Task, run
from odom.cli import app
from odom.errors import ConfigError, OdomError
from odom.evaluation.robustness import timing
from odom.evaluation.robustness.axes import AXES
from odom.evaluation.robustness.outcomes import COLUMNS, Outcomes, as_json, by_axis, markdown, rows, short_markdown
from odom.evaluation.robustness.spoiler import UNSPOILT, Spoiler
from odom.evaluation.robustness.verdict import Verdict
from odom.geometry import se3
from odom.service import replayed
from odom.service.replayed import frames_of
from sensors.catalogue import open_source
from sensors.source import SourceOptions

ARENA = str(Path(__file__).parents[2] / "recordings" / "arena.mcap")
CALM = Verdict(300, 0.004, 1.0, 1.0, 0.0, 0.0, 270, 6.0, None, 0, 1)
WEAK = Verdict(300, 0.0081, 0.9, 0.6, 0.3, 0.1, 150, 9.0, 0.75, 0, 2)
GONE = Verdict(300, None, 0.0, 0.0, 1.0, 0.0, 0, None, 10.0, 1, 0)
PARTIAL = Verdict(300, 0.003, 0.2, 0.2, 0.8, 0.0, 30, 5.0, 3.0, 1, 1)


def outcomes(*verdicts: Verdict) -> Outcomes:
    found = {("darkness", level): verdict for level, verdict in enumerate(verdicts)}
    return Outcomes("walk", 1, CALM, by_axis(chosen_axes(["darkness"]), found), 60.0, 100.0)


def test_the_table_says_what_each_level_does_and_where_the_ate_doubles():
    nothing, half, quarter, eighth = rows(outcomes(CALM, WEAK, GONE))
    assert nothing == ("nothing", "", "4", "x1.00", "100 %", "100 %", "0", "0", "6", "-", "1", "")
    assert half[:2] == ("share of the light, with noise", ".5")
    assert half[-1] == ".25"
    assert quarter[2:] == ("8.1", "x2.02", "90.0 %", "60.0 %", "30.0 %", "10.0 %", "9", "0.75", "2", "")
    assert eighth[2:] == ("-", "-", "-", "0", "100 %", "-", "-", "> 10.00", "0", "")
    assert all(len(row) == len(COLUMNS) for row in rows(outcomes(CALM, WEAK, GONE)))


def test_an_ate_of_few_frames_is_no_success():
    assert rows(outcomes(CALM, PARTIAL))[1][-1] == ".25"
    assert rows(outcomes(CALM, GONE))[1][-1] == ".25"
    assert rows(outcomes(CALM, CALM))[1][-1] == "no level"


def test_an_ate_over_as_many_frames_as_the_unspoilt_one_is_no_failure_where_truth_saw_few():
    seen = replace(CALM, ate_share=0.45)
    found = replace(outcomes(seen), unspoilt=seen)
    assert rows(found)[1][-1] == "no level"
    assert rows(replace(outcomes(replace(seen, ate_share=0.2)), unspoilt=seen))[1][-1] == ".5"


def test_a_share_that_is_nearly_nothing_is_not_called_nothing():
    nearly = Verdict(9000, 0.004, 1.0, 0.9999, 0.0001, 0.0001, 8000, 6.0, None, 0, 1)
    row = rows(outcomes(nearly))[1]
    assert row[5:8] == ("99.990%", "0.010%", "0.010%")


def test_a_run_that_failed_is_a_row_that_says_so():
    failed = Verdict(error="ValueError: no")
    assert rows(outcomes(failed))[1][2] == "ValueError: no"
    assert "ValueError: no" in markdown(outcomes(failed))
    assert json.loads(json.dumps(as_json(outcomes(failed))))["axes"]["darkness"]["ate_doubles_at"] == ".5"


def test_the_short_table_has_the_worst_of_each_axis():
    assert short_markdown(outcomes(CALM, WEAK, GONE)).splitlines()[2] == (
        "| share of the light, with noise | .5, .25, .12 | .25 | 0 at .12 | 10.0 % at .25 |"
    )
    assert short_markdown(outcomes(CALM)).splitlines()[2].endswith("| .5 | no level | 100 % | 0 |")
    assert short_markdown(outcomes(Verdict(error="ValueError: no"))).count("\n") == 2


def test_an_axis_that_is_not_known_is_refused():
    with pytest.raises(ConfigError, match="no axis is called fog: there are blur, darkness"):
        chosen_axes(["blur", "fog"])
    assert chosen_axes([]) == AXES


def test_a_source_that_is_not_there_is_refused_and_nothing_is_written(tmp_path):
    result = CliRunner().invoke(app, ["bench", "robustness", str(tmp_path / "none"), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, OdomError)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["robustness.json", "table.md", "robustness.png"])
def test_a_file_that_cannot_be_written_is_named(tmp_path, monkeypatch, name):
    monkeypatch.setattr(robustness_bench, "check_source", lambda *source: None)
    monkeypatch.setattr(robustness_bench, "measure_robustness", lambda *task: outcomes(CALM, WEAK, GONE))
    (tmp_path / name).mkdir()
    result = CliRunner().invoke(app, ["bench", "robustness", "walk", "--out", str(tmp_path)])
    assert isinstance(result.exception, OdomError), result.exception
    assert str(result.exception).startswith(f"{tmp_path / name} cannot be written")


@pytest.fixture
def in_process(monkeypatch):
    """Runs in this process instead of one of their own: imports and compiled code are loaded once."""

    def run_here(module, task, limit_s, stopped):
        return ChildResult((asdict(run(Task(**task))),), "")

    monkeypatch.setattr(robustness_bench, "run_child", run_here)


@pytest.mark.rendered
def test_two_axes_are_measured_on_a_few_seconds(in_process, tmp_path):
    chosen = ["--axis", "black-outs", "--axis", "focal", "--end", "4", "--jobs", "1"]
    result = CliRunner().invoke(app, ["bench", "robustness", ARENA, *chosen, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "out" / "robustness.json").read_text())
    assert list(found["axes"]) == ["black-outs", "focal"]
    assert found["unspoilt"]["tracked"] > 0.9
    dark, focal = (list(found["axes"][name]["levels"].values()) for name in found["axes"])
    assert [verdict["error"] for verdict in (*dark, *focal)] == [""] * 9
    assert dark[-1]["lost"] > 0.2
    assert focal[-1]["ate_m"] > 1.5 * found["unspoilt"]["ate_m"]
    assert (tmp_path / "out" / "table.md").read_text().count("\n") == (2 + 2) + 1 + (2 + 1 + 9)
    assert (tmp_path / "out" / "robustness.png").stat().st_size > 10_000
    assert "10 runs of" in result.output


@pytest.mark.process
def test_a_run_in_a_process_of_its_own_says_why_it_failed():
    with pytest.raises(OdomError, match=r"arena.mcap: InputError: .* poses"):
        measure_robustness([], Task(ARENA, "", 1, end=0.2), 1)


class Boaster(replayed.Odometry):
    """An odometry that believes it moves half as fast again as it does, and is sure of it."""

    def process(self, frame):
        found = super().process(frame)
        if found.second is None:
            return found
        T = se3.exp(1.5 * se3.log(found.second.T_earlier_current))
        return replace(found, second=replace(found.second, T_earlier_current=T, covariance=1e-6 * np.eye(6)))


@pytest.mark.rendered
def test_an_odometry_that_is_wrong_and_does_not_say_so_is_found_out(in_process, monkeypatch):
    task = Task(ARENA, "", 1, end=4.0)
    honest = measure_robustness([], task, 1).unspoilt
    monkeypatch.setattr(replayed, "Odometry", Boaster)
    boasting = measure_robustness([], task, 1).unspoilt
    assert honest.wrong == 0
    assert boasting.wrong > 0.3
    assert boasting.ate_m == honest.ate_m


@pytest.mark.rendered
def test_stamps_are_spoilt_before_images_are_paired():
    options = SourceOptions(end=2.0)

    def frames(spoiler):
        return [frame for _, frame in frames_of(open_source(ARENA, options).messages(), options.topics, spoiler)]

    def late(stream, stamp):
        return timing.late_depth(stream, stamp, 0.1)

    as_recorded, spoilt = frames(UNSPOILT), frames(Spoiler(stamp=late))
    assert [frame.stamp for frame in spoilt] == [frame.stamp for frame in as_recorded]
    moved = [abs(frame.depth_stamp - frame.stamp) for frame in spoilt[1:] if frame.depth_mm.any()]
    assert max(moved) < 0.07e9  # paired with the image before, not with its own at 100 ms
    assert (spoilt[9].depth_mm == as_recorded[8].depth_mm).all()
