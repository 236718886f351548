"""The default path: gate, robust recursion with both clouds' covariances, weighted projection; made for every frame."""

import numpy as np

from odom.errors import InputError
from odom.registration.fast import register_pairs
from odom.registration.gate import BOUND
from odom.registration.pairs import Array, Pairs, Prior, Registration, Verdict, degenerate

_NONE = np.empty((0, 3, 3))
_NO_PRIOR = np.empty((0, 0))
_IDENTITY = np.eye(4)
_MAX_ROTATION_SIGMA = 0.2
_MIN_SCATTER = 4.0
_TRUNCATED_MEAN = 0.995
"""Mean of chi-square (3) below the gate's .999 bound, relative to 3."""


def register(pairs: Pairs, prior: Prior | None = None, *, gated: bool = True, bound: float = BOUND) -> Registration:
    """Return the motion of `pairs` by the gated robust recursion, in about .3 ms for 400 pairs.

    `prior` is where the search begins (a motion prediction) and, if it has a covariance, evidence that is fused. The
    gate drops pairs whose squared residual exceeds `bound` against their own covariance `S_k = Sp + R Sq R'`;
    `gated=False` uses all. The verdict is DEGENERATE for fewer than 3 pairs, points on a line, and a consensus that
    chance could give. The covariance is multiplied by `variance_factor` where that is significantly above 1. Raises
    InputError for values that are not finite, covariances that are not positive, or missing covariances.
    """
    n = len(pairs)
    if pairs.covariances_source is None and pairs.covariances_target is None:
        raise InputError("the pairs have no covariances: give those of a noise model for at least one side")
    if n < 3:
        return degenerate(n, f"{n} pairs: at least 3 are needed")
    T = np.empty((4, 4))
    covariance = np.empty((6, 6))
    weights, chi2 = np.empty(n), np.full(n, np.nan)
    numbers = np.zeros(7)
    status = register_pairs(
        pairs.points_source,
        pairs.points_target,
        _NONE if pairs.covariances_source is None else pairs.covariances_source,
        _NONE if pairs.covariances_target is None else pairs.covariances_target,
        np.ones(n) if pairs.weights is None else pairs.weights,
        _NO_PRIOR
        if prior is None or prior.covariance is None
        else np.asarray(np.linalg.inv(prior.covariance), dtype=np.float64),
        _IDENTITY if prior is None else prior.T_target_source,
        prior is not None,
        gated,
        bound,
        T,
        covariance,
        np.empty((12, 12)),
        np.empty(12),
        weights,
        chi2,
        numbers,
    )
    if status > 0:
        raise InputError(
            f"the covariance of pair {status - 1} is not positive definite: leave it out, or add the pixel's noise"
        )
    if status == -3:
        raise InputError("points are not all finite: leave out pairs without a measurement")
    if status == -4:
        raise InputError("weights must be finite and not negative")
    inliers = weights > 0.0
    reason = _reason(status, numbers, covariance, has_prior=prior is not None and prior.covariance is not None)
    if reason:
        return degenerate(n, reason, chi2, inliers)
    freedom = 3.0 * numbers[0] - 6.0
    factor = float(numbers[1] / (freedom * _TRUNCATED_MEAN)) if freedom > 0.0 else 1.0
    if freedom > 0.0 and factor > 1.0 + 3.0 * np.sqrt(2.0 / freedom):
        covariance *= factor
    return Registration(
        T,
        covariance,
        inliers,
        chi2,
        float(numbers[4]),
        Verdict.OK,
        variance_factor=factor,
        details={"rounds": float(numbers[3])},
    )


def _reason(status: int, numbers: Array, covariance: Array, has_prior: bool) -> str:
    """Return why the result of `register_pairs` has no trustworthy pose, or nothing."""
    if status == -1:
        return f"no consensus: {int(numbers[0])} pairs agree, as chance would have it"
    if status == -2:
        return f"{int(numbers[0])} pairs do not determine the motion"
    if has_prior:
        return ""
    if numbers[5] < _MIN_SCATTER or numbers[6] < 1e-9:
        return f"{int(numbers[0])} points lie on a line, within their noise"
    sigma = float(np.sqrt(covariance[3:, 3:].diagonal().max()))
    if sigma > _MAX_ROTATION_SIGMA:
        return f"the rotation is uncertain by {np.degrees(sigma):.0f} degrees"
    return ""


def warm_up() -> None:
    """Compile (once an installation) or load the loops, so that the first frame is not late."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 1.0, (8, 3))
    small = np.full((8, 3), 1e-6)
    register(Pairs(points, points, small, small))
    register(Pairs(points, points, small, small), Prior(np.eye(4), np.eye(6)))
