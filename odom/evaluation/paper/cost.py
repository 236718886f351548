"""What a registration costs, against Horn's closed form in numpy in the same run; CPU time."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from odom.evaluation.paper.scenarios import (
    MAGNITUDES_M,
    Noise,
    clean_clouds,
    covariances,
    kinect_noise,
    noisy,
    with_outliers,
)
from odom.registration import Pairs, register, robust
from odom.registration.paper.closed_form import closed_form


@dataclass(frozen=True)
class Cost:
    """Median CPU time of a call, and the ratio to Horn's closed form on as many pairs in the same rounds."""

    what: str
    pairs: int
    time_ms: float
    ratio_to_horn: float


_HORN = "Horn / SVD in numpy"
_ROUNDS = 300
"""Calls of each, of which the median is taken: it is then steady to some per cent."""


def _costs(
    pairs: int, rounds: int, horn: Callable[[], object], calls: Mapping[str, Callable[[], object]]
) -> list[Cost]:
    """Return the median cost of each call and of `horn`, the calls taking turns so that all see the same machine.

    The first tenth of the rounds warms up and does not count.
    """
    calls = {_HORN: horn, **calls}
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            begun = time.thread_time()
            call()
            times[name].append(time.thread_time() - begun)
    seconds = {name: float(np.median(values[len(values) // 10 :])) for name, values in times.items()}
    return [Cost(name, pairs, 1e3 * value, value / seconds[_HORN]) for name, value in seconds.items()]


def _target_only(rng: np.random.Generator, n: int) -> Pairs:
    clean = clean_clouds(rng, n)
    C = covariances(rng, Noise.POINT, MAGNITUDES_M["average"], clean.true.points_target)
    return noisy(rng, clean, None, C).measured


def _both(rng: np.random.Generator, n: int) -> Pairs:
    return noisy(rng, *kinect_noise(rng, n)).measured


def costs() -> list[Cost]:
    """Return the cost of 400 pairs: Horn, RF with diagonal and full covariances, the gate with 30 % wrong pairs."""
    rng = np.random.default_rng(0)
    one, both, wrong = _target_only(rng, 400), _both(rng, 400), with_outliers(0, 0.3).measured
    calls = {
        "RF, diagonal covariances of the target": lambda: robust(one),
        "RF, full covariances of both clouds": lambda: robust(both),
        "gate + RF, full covariances, 30 % wrong": lambda: register(wrong),
    }
    return _costs(400, _ROUNDS, lambda: closed_form(one.points_source, one.points_target), calls)


def growth(sizes: tuple[int, ...] = (100, 1000, 10_000, 100_000)) -> list[Cost]:
    """Return the cost of RF and of the gate with 30 % wrong pairs against the number of pairs."""
    found = []
    for n in sizes:
        both, wrong = _both(np.random.default_rng(n), n), with_outliers(n, 0.3, n).measured
        horn = partial(closed_form, both.points_source, both.points_target)
        calls = {"RF": partial(robust, both), "gate + RF, 30 % wrong": partial(register, wrong)}
        found += _costs(n, max(5, 20_000 // n), horn, calls)
    return found
