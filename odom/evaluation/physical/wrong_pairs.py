"""Which kinds and shares of wrong pairs make the errors that the paper prints for Horn and EM-ICP.

Correct pairs of the experiment are spoilt: a share of the targets is replaced. The paper blames symmetric shapes, so
one kind moves all wrong targets by the same step, as a repeated pattern or the other half of a symmetric thing would.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from odom.evaluation.physical.judging import Outcome, Truth, judge, wrong_pairs
from odom.geometry.arrays import Array
from odom.registration import Pairs

SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Shares of wrong pairs."""
_NEARBY_M = 0.5
"""How far the wrong target of a nearby confusion is: the next thing on the desk."""
_STEP_M = 0.6
"""The step of a repeated pattern: the width of a cupboard or of a window."""


def _anywhere(rng: np.random.Generator, targets: Array) -> Array:
    """Return another of the key points for each, as a descriptor that says nothing would."""
    return np.asarray(targets[rng.permutation(len(targets))])


def _nearby(rng: np.random.Generator, targets: Array) -> Array:
    step = rng.normal(size=targets.shape)
    return np.asarray(targets + _NEARBY_M * step / np.linalg.norm(step, axis=1, keepdims=True))


def _repeated(rng: np.random.Generator, targets: Array) -> Array:
    heading = rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(targets + _STEP_M * np.array([np.cos(heading), 0.0, np.sin(heading)]))


KINDS: dict[str, Callable[[np.random.Generator, Array], Array]] = {
    "another key point": _anywhere,
    "something 0.5 m away": _nearby,
    "the same 0.6 m for all": _repeated,
}
"""What a wrong target is."""


@dataclass(frozen=True)
class Spoilt:
    """Mean RMSE in mm against truth at one kind and share of wrong pairs, by estimator, ungated and gated.

    `none` counts the sets of pairs that the gate refused, of `sets`.
    """

    sensor: str
    kind: str
    share: float
    ungated_mm: dict[str, float]
    gated_mm: dict[str, float]
    none: int
    sets: int


@dataclass(frozen=True)
class Match:
    """The share of wrong pairs at which an estimator's mean RMSE is the paper's, and what the others have there.

    `share` is None where it is never reached; `ungated_mm` and `gated_mm` are then empty.
    """

    sensor: str
    kind: str
    estimator: str
    paper_mm: float
    share: float | None
    ungated_mm: dict[str, float]
    gated_mm: dict[str, float]


def spoil(sensor: str, sets: Sequence[tuple[Pairs, Array]], seed: int) -> list[Spoilt]:
    """Return what each kind and share makes of the correct ones of each set of pairs with its true motion."""
    correct = [(pairs[~wrong_pairs(pairs, T)], T) for pairs, T in sets]
    found = []
    for k, kind in enumerate(KINDS):
        for share in SHARES:
            outcomes = []
            for number, (pairs, T) in enumerate(correct):
                rng = np.random.default_rng([seed, k, number])
                wrong = rng.permutation(len(pairs)) < round(share * len(pairs))
                targets = pairs.points_target.copy()
                targets[wrong] = KINDS[kind](rng, targets[wrong])
                told = replace(pairs, points_target=targets)
                outcomes += judge(told, Truth(T), number, kind)
            means = [
                {
                    name: float(np.mean(errors)) if (errors := _errors(outcomes, name, gated)) else float("nan")
                    for name in dict.fromkeys(o.estimator for o in outcomes)
                }
                for gated in (False, True)
            ]
            refused = sum(bool(o.reason) and o.is_gated and o.estimator == "RF" for o in outcomes)
            found.append(Spoilt(sensor, kind, share, means[0], means[1], refused, len(correct)))
    return found


def _errors(outcomes: Sequence[Outcome], name: str, is_gated: bool) -> list[float]:
    return [o.rmse_mm for o in outcomes if (o.estimator, o.is_gated, o.reason) == (name, is_gated, "")]


def matches(spoilt: Sequence[Spoilt], paper_mm: dict[str, float], names: Sequence[str]) -> list[Match]:
    """Return, for each kind and each of `names`, where the ungated error reaches the paper's, between two shares."""
    found = []
    for kind in dict.fromkeys(each.kind for each in spoilt):
        rising = [each for each in spoilt if each.kind == kind]
        for name in names:
            goal = paper_mm[name]
            errors = np.array([each.ungated_mm[name] for each in rising])
            beyond = np.flatnonzero(errors >= goal)
            if not len(beyond) or beyond[0] == 0:
                found.append(Match(rising[0].sensor, kind, name, goal, None, {}, {}))
                continue
            after = int(beyond[0])
            low, high = rising[after - 1], rising[after]
            w = float((goal - errors[after - 1]) / (errors[after] - errors[after - 1]))
            found.append(
                Match(
                    low.sensor,
                    kind,
                    name,
                    goal,
                    low.share + w * (high.share - low.share),
                    _between(low.ungated_mm, high.ungated_mm, w),
                    _between(low.gated_mm, high.gated_mm, w),
                )
            )
    return found


def _between(low: dict[str, float], high: dict[str, float], w: float) -> dict[str, float]:
    return {name: (1.0 - w) * low[name] + w * high[name] for name in low}
