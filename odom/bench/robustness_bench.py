"""The runs behind `odom bench robustness`: each level of an axis in a process of its own.

What a process does is in `odom.bench.robustness_run`.
"""

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, replace
from pathlib import Path

from odom.bench.bench_child import patience_s, run_child
from odom.bench.robustness_run import Task
from odom.errors import ConfigError, OdomError
from odom.evaluation.robustness.axes import AXES, Axis
from odom.evaluation.robustness.outcomes import Outcomes, by_axis
from odom.evaluation.robustness.verdict import Verdict
from sensors.catalogue import open_source
from sensors.source import SourceOptions


def chosen_axes(names: Sequence[str]) -> tuple[Axis, ...]:
    """Return the axes of these names in the order of the table, all of them for none; raises ConfigError."""
    known = [axis.name for axis in AXES]
    if unknown := [name for name in names if name not in known]:
        raise ConfigError(f"no axis is called {', '.join(unknown)}: there are {', '.join(known)}")
    return tuple(axis for axis in AXES if not names or axis.name in names)


def check_source(source: str, camera: Path | None, end: float | None) -> None:
    """Raise ConfigError for a source that cannot be run again and again, SourceError for one that cannot be opened."""
    opened = open_source(source, SourceOptions(camera=camera, end=end))
    is_recorded = opened.lossless
    opened.close()
    if not is_recorded:
        raise ConfigError(f"{source} is live: record it, with motion capture, and give the recording")


def measure_robustness(
    axes: Sequence[Axis],
    task: Task,
    jobs: int,
    progress: Callable[[int], None] = lambda runs: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Outcomes:
    """Return what each level of the axes does; levels that were not run when `stopped` are left out.

    `task` is the unspoilt run; its file of truth may be left empty. `progress` is told how many runs have ended.
    Raises OdomError when the unspoilt run fails.
    """
    begun, cpu_begun_s = time.monotonic(), _cpu_s()
    verdicts: dict[tuple[str, int], Verdict] = {}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        task = replace(task, truth=str(Path(folder) / "truth.txt"))
        unspoilt = _verdict(task, None, stopped)
        if unspoilt.error and not stopped():
            raise OdomError(f"{task.source}: {unspoilt.error}")
        progress(1)
        limit_s = patience_s(time.monotonic() - begun)
        running = {
            pool.submit(_verdict, replace(task, axis=axis.name, level=level), limit_s, stopped): (axis.name, level)
            for axis in axes
            for level in range(len(axis.levels))
        }
        for done, future in enumerate(as_completed(running), 2):
            if not stopped():
                verdicts[running[future]] = future.result()
                progress(done)
    took_s = time.monotonic() - begun, _cpu_s() - cpu_begun_s
    return Outcomes(task.source, task.seed, unspoilt, by_axis(axes, verdicts), *took_s)


def _cpu_s() -> float:
    """Return the CPU seconds of this process and of its children that have ended."""
    return sum(os.times()[:4])


def _verdict(task: Task, limit_s: float | None, stopped: Callable[[], bool]) -> Verdict:
    if stopped():
        return Verdict(error="stopped")
    child = run_child("odom.bench.robustness_run", asdict(task), limit_s, stopped)
    return Verdict(**child.values[0]) if child.values else Verdict(error=child.why)
