"""The default registration: gate for wrong pairs, recursion with both clouds' noise, weighted projection."""

import math

import numpy as np

from odom.errors import InputError, check_type
from odom.registration.checked_arrays import checked
from odom.registration.gate import BOUND, gate
from odom.registration.pairs import Pairs, Prior, Registration, degenerate
from odom.registration.result import NoiseScale, registration_of
from odom.registration.solution import solve
from odom.registration.tuning import TUNING

_TRUNCATED_MEAN = 0.995
"""Mean of chi-square (3) below the gate's .999 bound, relative to 3; so near to 1 that the covariance leaves it out."""


def register(pairs: Pairs, prior: Prior | None = None, *, bound: float = BOUND) -> Registration:
    """Return the motion of `pairs` by the gated robust recursion, in about .3 ms for 400 pairs.

    `prior` is where the search begins (a motion prediction) and, if it has a covariance, evidence that is fused. The
    gate drops pairs whose squared residual exceeds `bound` against their own covariance `S_k = Sp + R Sq R'`. The
    verdict is DEGENERATE for fewer than 4 pairs (3 agree on some motion by chance), points on a line, and a consensus
    that chance could give. The covariance is multiplied by `variance_factor` where that is significantly above 1.
    Raises InputError for values that are not finite, clouds 100 km or more from the origin, covariances that are not
    positive definite or missing, and a bound that is not positive.
    """
    if not 0.0 < bound < math.inf:
        raise InputError(f"bound = {bound}: give a finite, positive number of squared sigmas, as {BOUND} is")
    arrays = checked(pairs)
    check_type("prior", prior, Prior | None, "Prior(T_target_source), or None")
    n = len(arrays.q)
    if n < 3:
        return degenerate(n, f"{n} pairs: at least 3 are needed")
    T = np.eye(4) if prior is None else prior.T_target_source
    passed = gate(arrays, T, prior is not None, bound)
    if not passed.believable:
        reason = f"no consensus: {passed.inliers} of {n} pairs agree, as chance would have it"
        return degenerate(n, reason, passed.chi2, passed.weights > 0.0)
    solution = solve(arrays, prior, passed.T_target_source, passed.weights, bound)
    freedom = solution.freedom
    stricter = truncated_mean(BOUND) / truncated_mean(bound)
    factor = float(solution.sums[1]) / (freedom * _TRUNCATED_MEAN) * stricter if freedom > 0.0 else 1.0
    excessive = freedom > 0.0 and factor > 1.0 + TUNING.variance_factor_sigmas * math.sqrt(2.0 / freedom)
    noise = NoiseScale((factor if excessive else 1.0) * stricter, factor, {"rounds": float(passed.rounds)})
    return registration_of(arrays, prior, solution, noise)


def truncated_mean(bound: float) -> float:
    """Return the mean of chi-square (3) below `bound` > 0, relative to 3: `F5(bound) / F3(bound)`.

    That is how much smaller the residuals look of which the gate has cut off the tails; and the motion of the pairs
    left is by as much less sure than their number says.
    """
    if bound < 1e-3:
        return bound / 5.0  # the first term of the series, where the differences below lose their digits
    density = math.sqrt(2.0 * bound / math.pi) * math.exp(-0.5 * bound)
    below = math.erf(math.sqrt(0.5 * bound)) - density  # F3
    return 1.0 - bound / 3.0 * density / below


def warm_up() -> None:
    """Compile (once per installation) or load the loops, so that the first registration is not late."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 1.0, (8, 3))
    small = np.full((8, 3), 1e-6)
    register(Pairs(points, points, small, small))
    register(Pairs(points, rng.permuted(points), small, small), Prior(np.eye(4), np.eye(6)))
