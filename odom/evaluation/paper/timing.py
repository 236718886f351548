"""What a registration costs, against Horn's closed form in numpy in the same run; CPU time."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from odom.evaluation.paper.scenarios import MAGNITUDES_M, Noise, Sample, clean_clouds, covariances, noisy, with_outliers
from odom.registration import Pairs, register, robust
from odom.registration.closed_form import closed_form


@dataclass(frozen=True)
class Cost:
    """Median CPU time of a call, and the ratio to Horn's closed form on as many pairs in the same rounds."""

    what: str
    pairs: int
    time_ms: float
    ratio_to_horn: float


def _medians(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the median CPU seconds of each call, the calls taking turns so that all see the same machine."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            begun = time.thread_time()
            call()
            times[name].append(time.thread_time() - begun)
    return {name: float(np.median(values[len(values) // 10 :])) for name, values in times.items()}


def _sample(rng: np.random.Generator, n: int, both: bool) -> Sample:
    clean = clean_clouds(rng, n)
    range_m = MAGNITUDES_M["average"]
    if both:
        C = [covariances(rng, Noise.KINECT, range_m, p) for p in (clean.true.points_source, clean.true.points_target)]
        return noisy(rng, clean, C[0], C[1])
    return noisy(rng, clean, None, covariances(rng, Noise.POINT, range_m, clean.true.points_target))


def costs(rounds: int = 300) -> list[Cost]:
    """Return the cost of 400 pairs: Horn, RF with diagonal and full covariances, the gate with 30 % wrong pairs."""
    rng = np.random.default_rng(0)
    one, both, wrong = _sample(rng, 400, False).told, _sample(rng, 400, True).told, with_outliers(0, 0.3).told
    horn = "Horn / SVD in numpy"
    calls: dict[str, Callable[[], object]] = {
        horn: lambda: closed_form(one.points_source, one.points_target),
        "RF, diagonal covariances of the target": lambda: robust(one),
        "RF, full covariances of both clouds": lambda: robust(both),
        "gate + RF, full covariances, 30 % wrong": lambda: register(wrong),
    }
    seconds = _medians(calls, rounds)
    return [Cost(name, 400, 1e3 * value, value / seconds[horn]) for name, value in seconds.items()]


def growth(sizes: tuple[int, ...] = (100, 1000, 10_000, 100_000)) -> list[Cost]:
    """Return the cost of RF and of the gate with 30 % wrong pairs against the number of pairs."""
    found = []
    for n in sizes:
        rng = np.random.default_rng(n)
        both, wrong = _sample(rng, n, True).told, with_outliers(n, 0.3, n).told
        found += [
            Cost(name, n, 1e3 * seconds, ratio)
            for name, seconds, ratio in _against_horn(both, wrong, max(5, 20_000 // n))
        ]
    return found


def _against_horn(both: Pairs, wrong: Pairs, rounds: int) -> list[tuple[str, float, float]]:
    calls: dict[str, Callable[[], object]] = {
        "Horn / SVD in numpy": lambda: closed_form(both.points_source, both.points_target),
        "RF": lambda: robust(both),
        "gate + RF, 30 % wrong": lambda: register(wrong),
    }
    seconds = _medians(calls, rounds)
    return [(name, value, value / seconds["Horn / SVD in numpy"]) for name, value in seconds.items()]
