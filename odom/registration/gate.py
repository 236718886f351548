"""The gate for wrong pairs: graduated non-convexity first, sets of pairwise consistent pairs where that fails."""

import math
from dataclasses import dataclass

import numpy as np

from odom.geometry.arrays import Array
from odom.registration.checked_arrays import Arrays
from odom.registration.false_alarms import chance, is_believable
from odom.registration.graduated_non_convexity import Schedule, graduate
from odom.registration.measurement_covariance import bad_covariance
from odom.registration.pairwise_consistency import rate, rigid_set
from odom.registration.tuning import TUNING

BOUND = 16.27
"""The .999 quantile of chi-square with 3 degrees of freedom: beyond it a pair is wrong."""
_SCHEDULE = Schedule(
    begin_share=TUNING.gate_begin_share,
    growth=1.0 + TUNING.gate_mu_step,
    full_mu=TUNING.gate_full_precision_mu,
    turn_cosine=math.cos(TUNING.gate_relinearise_rad),
)


@dataclass(frozen=True, eq=False)
class Gated:
    """What passed the gate: weights and squared residuals (n each), and the motion they agree on.

    Weights of wrong pairs are 0; `believable` says whether so many pairs agree, those that repeat a spot counted
    once, that chance cannot be the reason.
    """

    weights: Array
    chi2: Array
    T_target_source: Array
    rounds: int
    believable: bool

    @property
    def inliers(self) -> int:
        """The number of pairs that passed."""
        return int(np.count_nonzero(self.weights))


def gate(arrays: Arrays, T: Array, near: bool, bound: float = BOUND) -> Gated:
    """Return the pairs that agree on one motion, each within `bound` of its own covariance.

    `T` (4 x 4) is where to begin if `near`. Where graduation ends in a consensus that chance may have made, sets of
    consistent pairs are graduated instead, the best rated seeds first, until one is believable. O(n) in time and
    memory. Raises InputError for a covariance that is not positive definite.
    """
    given = arrays.weights
    n, used = len(given), int(np.count_nonzero(given))
    W, chi2 = np.empty((n, 8)), np.full(n, np.nan)
    probability = -1.0

    def attempt(mask: Array, start: Array, is_near: bool) -> Gated:
        nonlocal probability
        motion = start.copy()
        rounds = graduate(arrays._replace(weights=mask), motion, is_near, bound, _SCHEDULE, W, chi2)
        if rounds < 0:
            raise bad_covariance(-1 - rounds)
        if probability < 0.0:
            probability = chance(arrays.p, W, given, bound)
        weights = np.where(chi2 <= bound, given, 0.0)
        odds = probability, math.log(TUNING.gate_false_alarms)
        believable = is_believable(arrays, W, motion, weights, bound, odds)
        return Gated(weights, chi2.copy(), motion, rounds, believable)

    best = attempt(given, T, near)
    if best.believable or used < 4:
        return best
    tolerance = TUNING.gate_distance_sigmas**2
    rating, mask = np.empty(min(n, TUNING.gate_seeds)), np.empty(n)
    rate(arrays, tolerance, rating)
    for seed in np.argsort(-rating, kind="stable")[: TUNING.gate_trials]:
        i = int(seed) * n // len(rating)
        if rigid_set(arrays, tolerance, TUNING.gate_partners, i, mask) < 4:
            continue
        found = attempt(mask, np.eye(4), False)
        if found.believable or found.inliers > best.inliers:
            best = found
        if best.believable:
            break
    return best
