"""Which kinds and shares of wrong pairs make the errors that the paper prints for Horn and EM-ICP.

Correct pairs of the experiment are spoilt: a share of the targets is replaced. The paper blames symmetric shapes, so
one kind moves all wrong targets by the same step, as a repeated pattern or the other half of a symmetric thing would.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from odom.evaluation.physical.judging import Outcome, Truth, judge, rmse_mm, wrong_pairs
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.registration import Pairs
from odom.registration.paper.closed_form import closed_form

SHARES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
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


MEASURES = ("to truth", "to all measured targets")
"""What an error is measured against; the second is the paper's definition of its RMSE."""


@dataclass(frozen=True)
class Spoilt:
    """Mean RMSE in mm at one kind and share of wrong pairs, by estimator.

    `ungated_mm` and `gated_mm` are against truth, `measured_mm` against the measured targets of all pairs, wrong ones
    too, without the gate. `none` counts the sets of pairs that the gate refused, of `sets`. Horn's closed form is
    believed here even where its residuals contradict its motion, which the benches call DEGENERATE.
    """

    sensor: str
    kind: str
    share: float
    ungated_mm: dict[str, float]
    measured_mm: dict[str, float]
    gated_mm: dict[str, float]
    none: int
    sets: int


@dataclass(frozen=True)
class Match:
    """The share of wrong pairs at which an ungated estimator's mean RMSE is the paper's, by one of two measures.

    There all estimators have `ungated_mm`, by that measure, and `gated_mm`, against truth; both are empty where the
    `share` is None: the figure is never reached.
    """

    sensor: str
    kind: str
    measure: str
    estimator: str
    paper_mm: float
    share: float | None
    ungated_mm: dict[str, float]
    gated_mm: dict[str, float]


def spoil(sensor: str, sets: Sequence[tuple[Pairs, Array]], seed: int) -> list[Spoilt]:
    """Return the outcomes for each kind and share of spoiling the correct pairs of each set, given its true motion."""
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
                spoilt = replace(pairs, points_target=targets)
                outcomes += [_with_plain_horn(o, spoilt, T) for o in judge(spoilt, Truth(T), number, kind)]
            ungated, gated = ([o for o in outcomes if o.is_gated is which] for which in (False, True))
            found.append(
                Spoilt(
                    sensor,
                    kind,
                    share,
                    _means(ungated, "rmse_mm"),
                    _means(ungated, "rmse_noisy_mm"),
                    _means(gated, "rmse_mm"),
                    sum(bool(o.reason) for o in gated if o.estimator == "RF"),
                    len(correct),
                )
            )
    return found


def _with_plain_horn(outcome: Outcome, pairs: Pairs, T: Array) -> Outcome:
    """Return the outcome; for Horn without gate, that of its closed form, believable or not."""
    if outcome.estimator != "Horn" or outcome.is_gated or not outcome.reason or len(pairs) < 3:
        return outcome
    motion = closed_form(pairs.points_source, pairs.points_target)
    right = pairs.points_source[~wrong_pairs(pairs, T)]
    true = rmse_mm(motion, right, se3.apply(T, right)) if len(right) else float("nan")
    noisy = rmse_mm(motion, pairs.points_source, pairs.points_target)
    return replace(outcome, rmse_mm=true, rmse_noisy_mm=noisy, reason="")


def _means(outcomes: Sequence[Outcome], field: str) -> dict[str, float]:
    """Return the mean of a field over the outcomes with a pose, NaN without any, by estimator."""
    names = dict.fromkeys(outcome.estimator for outcome in outcomes)
    each = {name: [getattr(o, field) for o in outcomes if o.estimator == name and not o.reason] for name in names}
    return {name: float(np.mean(values)) if values else float("nan") for name, values in each.items()}


def matches(spoilt: Sequence[Spoilt], paper_mm: dict[str, float], names: Sequence[str]) -> list[Match]:
    """Return, by both measures, for each kind and each of `names`, where the ungated error reaches the paper's."""
    return [
        _match([each for each in spoilt if each.kind == kind], measure, name, paper_mm[name])
        for measure in MEASURES
        for kind in dict.fromkeys(each.kind for each in spoilt)
        for name in names
    ]


def _match(rising: Sequence[Spoilt], measure: str, name: str, goal_mm: float) -> Match:
    """Return where the error first passes the goal between two shares of one kind, in increasing order."""
    errors = [each.ungated_mm if measure == MEASURES[0] else each.measured_mm for each in rising]
    sensor, kind = rising[0].sensor, rising[0].kind
    for before, after in pairwise(range(len(rising))):
        low, high = errors[before][name], errors[after][name]
        if low < goal_mm <= high:
            w = (goal_mm - low) / (high - low)
            share = (1.0 - w) * rising[before].share + w * rising[after].share
            both = (errors[before], errors[after]), (rising[before].gated_mm, rising[after].gated_mm)
            return Match(sensor, kind, measure, name, goal_mm, share, *(_between(*ends, w) for ends in both))
    return Match(sensor, kind, measure, name, goal_mm, None, {}, {})


def _between(low: dict[str, float], high: dict[str, float], w: float) -> dict[str, float]:
    return {name: (1.0 - w) * low[name] + w * high[name] for name in low}
