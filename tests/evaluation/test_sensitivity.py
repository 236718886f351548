import json
import math
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from odom.bench.robustness_run import Task
from odom.bench.sensitivity_bench import label, measure_sensitivity, spoilt
from odom.cli import app
from odom.errors import ConfigError
from odom.evaluation.robustness.verdict import Verdict
from odom.evaluation.sensitivity import (
    Level,
    Sensitivity,
    TunedNumber,
    as_json,
    by_effect,
    cells,
    changes,
    markdown,
    numbers_of,
    tuned_numbers,
)
from odom.geometry.tuning import tuned

ARENA = str(Path(__file__).parents[2] / "recordings" / "arena.mcap")


@dataclass(frozen=True)
class Tuning:
    gate_px: float = tuned(6.0, unit="px", effect="-", source="-")
    rounds: int = tuned(5, unit="1", effect="-", source="-")
    least: int = tuned(1, unit="1", effect="-", source="-")
    is_quick: bool = tuned(True, unit="1", effect="-", source="-")


def test_numbers_are_halved_and_doubled_and_whole_ones_stay_whole_and_at_least_one() -> None:
    gate, rounds, least = numbers_of("made.up", Tuning)
    assert gate == TunedNumber("made.up.gate_px", 6.0, "px")
    assert changes(gate) == {Level.LESS: 3.0, Level.MORE: 12.0}
    assert changes(rounds) == {Level.LESS: 2, Level.MORE: 10}
    assert changes(least) == {Level.MORE: 2}
    assert changes(replace(rounds, factor=10.0)) == {Level.LESS: 1, Level.MORE: 50}
    assert changes(replace(rounds, factor=1.1)) == {Level.LESS: 4, Level.MORE: 6}
    assert changes(replace(gate, factor=10.0)) == pytest.approx({Level.LESS: 0.6, Level.MORE: 60.0})
    assert all(isinstance(value, int) for value in changes(rounds).values())


def test_the_page_on_tuned_numbers_has_every_one_by_its_name_and_value() -> None:
    page = (Path(__file__).parents[2] / "odom" / "docs" / "sensitivity.md").read_text()
    values = {number.key: number.value for number in tuned_numbers()}
    table = dict(re.findall(r"^\| (\w+\.[\w.]+) \| ([^|]+) \|", page, re.MULTILINE))
    assert {key: value for key, value in table.items() if float(value) != values.get(key)} == {}
    without_effect = [
        (package, name)
        for package, names in re.findall(r"^- `([a-z_.]+)`(?: \(see below\))?: (.*)$", page, re.MULTILINE)
        for name in names.split(", ")
    ]
    ends = {(key.rpartition(".")[0], key.rpartition(".")[2]) for key in values}
    assert [each for each in without_effect if not any(p.startswith(each[0]) and n == each[1] for p, n in ends)] == []
    assert f"The {len(table) + len(without_effect)} numbers" in page
    swept = [key for key in values if not key.startswith("backend.chain.")]
    assert [key for key in swept if not re.search(rf"\b{key.rpartition('.')[2]}\b", page)] == []


USUAL = Verdict(frames=100, ate_m=0.010, nees=6.0, tracked=1.0)


def found(key: str, half: Verdict, double: Verdict) -> Sensitivity:
    levels = {Level.LESS: half, Level.AS_IS: USUAL, Level.MORE: double}
    return Sensitivity(TunedNumber(key, 2.0, "px"), {"walk": levels})


CALM = found("a.calm", replace(USUAL, ate_m=0.011), replace(USUAL, nees=6.3))
STRONG = found("a.strong", replace(USUAL, nees=2.0), replace(USUAL, tracked=0.6, wrong=0.02))
FAILING = found("a.failing", Verdict(error="ValueError: no"), USUAL)


def test_the_strongest_comes_first_and_a_failure_before_it() -> None:
    assert by_effect([CALM, STRONG, FAILING]) == [FAILING, STRONG, CALM]
    assert STRONG.largest_change == pytest.approx(3.0)
    assert CALM.largest_change == pytest.approx(1.1)
    assert math.isinf(FAILING.largest_change)


def test_the_table_has_figures_with_ratios_and_says_what_failed() -> None:
    failing, strong, calm = cells([FAILING, STRONG, CALM])
    assert calm == (
        "a.calm",
        "2",
        "px",
        "x1.1",
        "walk",
        "11 (1.10)",
        "10",
        "10 (1.00)",
        "6 (1.00)",
        "6",
        "6.3 (1.05)",
        "",
    )
    assert strong[-1] == "more: 60% tracked (of 100%), 2% TRACKING and wrong (of 0%)"
    assert failing[3] == failing[5] == "failed"
    assert failing[-1] == "less: ValueError: no"
    assert markdown([CALM]).splitlines()[2].startswith("| a.calm | 2 | px | x1.1 | walk | 11 (1.10) |")
    assert cells([found("a.idle", USUAL, USUAL)])[0][3] == "none"
    assert json.loads(json.dumps(as_json([FAILING])))[0]["largest_change"] is None


@pytest.mark.process
def test_a_value_that_fails_is_a_row_that_says_so() -> None:
    number = TunedNumber("frontend.no_such_number", 2.0, "px")
    (row,) = measure_sensitivity([number], [Task(ARENA, "", 1, end=4.0)])
    levels = row.outcomes[ARENA]
    assert levels[Level.AS_IS].ate_m
    assert levels[Level.LESS].error
    assert math.isinf(row.largest_change)


@pytest.mark.process
def test_one_number_of_the_odometry_is_tried_on_a_few_seconds(tmp_path: Path) -> None:
    numbers = tuned_numbers("backend.tracking.inlier_chi2")
    files = ["--json", str(tmp_path / "s.json"), "--markdown", str(tmp_path / "new" / "s.md")]
    chosen = ["--only", numbers[0].key, "--seconds", "4", "--jobs", "2"]
    result = CliRunner().invoke(app, ["bench", "sensitivity", ARENA, *chosen, *files])
    assert result.exit_code == 0, result.output
    (row,) = json.loads((tmp_path / "s.json").read_text())
    levels = row["outcomes"][ARENA]
    assert set(levels) == {"less", "as is", "more"}
    assert all(outcome["ate_m"] > 0 and outcome["nees"] > 0 for outcome in levels.values())
    assert len({outcome["ate_m"] for outcome in levels.values()}) == 3
    assert numbers[0].key in (tmp_path / "new" / "s.md").read_text()


@pytest.mark.process
def test_a_number_is_tried_on_a_spoilt_source_too() -> None:
    plain = Task(ARENA, "", 1, end=4.0)
    dark = spoilt(plain, "darkness=.03")
    (row,) = measure_sensitivity(tuned_numbers("backend.tracking.inlier_chi2"), [plain, dark])
    assert list(row.outcomes) == [ARENA, f"{ARENA} darkness=.03"] == [label(plain), label(dark)]
    clean, spoiled = (levels[Level.AS_IS] for levels in row.outcomes.values())
    assert spoiled.tracked <= clean.tracked
    assert spoiled.ate_m != clean.ate_m
    assert not any(verdict.error for levels in row.outcomes.values() for verdict in levels.values())


def test_spoiling_that_there_is_not_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"nothing is spoilt by darkness=2: there are .*darkness=.5"):
        spoilt(Task(ARENA, "", 1), "darkness=2")


def test_a_pattern_that_no_number_has_is_refused() -> None:
    result = CliRunner().invoke(app, ["bench", "sensitivity", ARENA, "--only", "nothing.*"])
    assert "no tuned number is called nothing.*" in str(result.exception)


def test_numbers_are_chosen_by_several_patterns() -> None:
    chosen = tuned_numbers("backend.tracking.jerk_*", "frontend.camera.noise_gain", factor=10.0)
    assert {number.key.rpartition(".")[2] for number in chosen} == {"jerk_m_s2", "jerk_rad_s2", "noise_gain"}
    assert all(number.factor == 10.0 for number in chosen)


def test_every_number_of_the_algorithms_can_be_changed_from_outside() -> None:
    """In one process that changes all of them at once: a name that does not reach its package is refused."""
    doubled = {number.key: changes(number)[Level.MORE] for number in tuned_numbers() if changes(number)}
    assert len(doubled) > 100
    program = "import json, sys, odom.bench.sensitivity_run as run; run.put_in_place(json.load(sys.stdin))"
    command = [sys.executable, "-c", program]
    run = subprocess.run(command, input=json.dumps(doubled), capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
