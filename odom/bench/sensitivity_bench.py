"""The runs behind `odom bench sensitivity`: each value of a tuned number in a process of its own.

A package reads its tuned numbers when it is first imported, so a changed one needs a fresh process; what it does is in
`odom.bench.sensitivity_run`.
"""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass

from odom.bench.bench_child import patience_s, run_child
from odom.errors import OdomError
from odom.evaluation.sensitivity import Level, Outcome, Sensitivity, TunedNumber, by_effect, changes


@dataclass(frozen=True)
class Runs:
    """What all runs share: sources, the seconds of each (None: all), files of calibration and settings, if any."""

    sources: tuple[str, ...]
    seconds: float | None = None
    camera: str | None = None
    config: str | None = None


def measure_sensitivity(
    numbers: Sequence[TunedNumber],
    runs: Runs,
    jobs: int = 1,
    progress: Callable[[int], None] = lambda runs: None,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Sensitivity]:
    """Return what halving and doubling each number does, sorted by effect; what was not run when `stopped` is left out.

    `progress` is told how many processes have ended. Raises OdomError when the odometry as it is fails on a source.
    """
    begun = time.monotonic()
    usual = _outcomes(runs, {}, None, stopped)
    limit_s = patience_s(time.monotonic() - begun)
    progress(1)
    for source, outcome in usual.items():
        if outcome.error and not stopped():
            raise OdomError(f"{source}: {outcome.error}")
    found: dict[str, dict[Level, dict[str, Outcome]]] = {}
    with ThreadPoolExecutor(jobs) as pool:
        running = {
            pool.submit(_outcomes, runs, {number.key: value}, limit_s, stopped): (number.key, level)
            for number in numbers
            for level, value in changes(number).items()
        }
        for done, future in enumerate(as_completed(running), 2):
            key, level = running[future]
            if not stopped():
                found.setdefault(key, {Level.AS_IS: usual})[level] = future.result()
                progress(done)
    return by_effect(Sensitivity(number, _by_source(found[number.key])) for number in numbers if number.key in found)


def _by_source(levels: dict[Level, dict[str, Outcome]]) -> dict[str, dict[Level, Outcome]]:
    return {
        source: {level: levels[level][source] for level in Level if level in levels} for source in levels[Level.AS_IS]
    }


def _outcomes(
    runs: Runs, overrides: dict[str, float | int], limit_s: float | None, stopped: Callable[[], bool]
) -> dict[str, Outcome]:
    """Return the outcome of each source, from a process of its own."""
    if stopped():
        return {}
    task = {"runs": asdict(runs), "overrides": overrides}
    child = run_child("odom.bench.sensitivity_run", task, limit_s, stopped)
    found = {source: Outcome(**outcome) for source, outcome in child.values}
    return {source: found.get(source, Outcome(error=child.why)) for source in runs.sources}
