"""The runs behind `odom bench sensitivity`: each value of a tuned number in a process of its own.

A package reads its tuned numbers when it is first imported, so a changed one needs a fresh process; what it does is in
`odom.bench.sensitivity_run`.
"""

import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, replace
from pathlib import Path

from odom.bench.bench_child import patience_s, run_child
from odom.bench.robustness_run import Task
from odom.errors import ConfigError, OdomError
from odom.evaluation.robustness.axes import AXES
from odom.evaluation.robustness.verdict import Verdict
from odom.evaluation.sensitivity import Level, Sensitivity, TunedNumber, by_effect, changes


def spoilt(task: Task, text: str) -> Task:
    """Return the task with its source spoilt as `AXIS=LEVEL` says, by the names of `odom bench robustness`.

    Raises ConfigError for an axis or a level that there is not.
    """
    known = {f"{axis.name}={level.label}": (axis.name, i) for axis in AXES for i, level in enumerate(axis.levels)}
    if text not in known:
        raise ConfigError(f"nothing is spoilt by {text}: there are {', '.join(known)}")
    axis, level = known[text]
    return replace(task, axis=axis, level=level)


def label(task: Task) -> str:
    """Return what a task runs over: `SOURCE`, or `SOURCE AXIS=LEVEL`."""
    levels = {axis.name: axis.levels for axis in AXES}
    return task.source if task.axis is None else f"{task.source} {task.axis}={levels[task.axis][task.level].label}"


def measure_sensitivity(
    numbers: Sequence[TunedNumber],
    tasks: Sequence[Task],
    jobs: int = 1,
    progress: Callable[[int], None] = lambda runs: None,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Sensitivity]:
    """Return what less and more of each number does, sorted by effect; what was not run when `stopped` is left out.

    A source's unspoilt task comes before its spoilt ones; their files of truth may be left empty. `progress` is told
    how many processes have ended. Raises OdomError when the odometry as it is fails on a source.
    """
    found: dict[str, dict[Level, dict[str, Verdict]]] = {}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        files = {source: str(Path(folder) / str(i) / "truth.txt") for i, source in enumerate({t.source for t in tasks})}
        for file in files.values():
            Path(file).parent.mkdir()
        tasks = [replace(task, truth=files[task.source]) for task in tasks]
        begun = time.monotonic()
        usual = _verdicts(tasks, {}, None, stopped)
        limit_s = patience_s(time.monotonic() - begun)
        progress(1)
        for name, verdict in usual.items():
            if verdict.error and not stopped():
                raise OdomError(f"{name}: {verdict.error}")
        running = {
            pool.submit(_verdicts, tasks, {number.key: value}, limit_s, stopped): (number.key, level)
            for number in numbers
            for level, value in changes(number).items()
        }
        for done, future in enumerate(as_completed(running), 2):
            key, level = running[future]
            if not stopped():
                found.setdefault(key, {Level.AS_IS: usual})[level] = future.result()
                progress(done)
    return by_effect(Sensitivity(number, _by_run(found[number.key])) for number in numbers if number.key in found)


def _by_run(levels: dict[Level, dict[str, Verdict]]) -> dict[str, dict[Level, Verdict]]:
    return {name: {level: levels[level][name] for level in Level if level in levels} for name in levels[Level.AS_IS]}


def _verdicts(
    tasks: Sequence[Task], overrides: dict[str, float | int], limit_s: float | None, stopped: Callable[[], bool]
) -> dict[str, Verdict]:
    """Return the verdict on each task by its label, from a process of its own."""
    if stopped():
        return {}
    given = {"tasks": [asdict(task) for task in tasks], "overrides": overrides}
    child = run_child("odom.bench.sensitivity_run", given, limit_s, stopped)
    found = {number: Verdict(**verdict) for number, verdict in child.values}
    return {label(task): found.get(number, Verdict(error=child.why)) for number, task in enumerate(tasks)}
