"""KF: the paper's Algorithm 1, corrected, on the joint state [R | t]; it takes the given covariances as exact."""

import numpy as np

from odom.geometry.arrays import Array
from odom.registration.checked_arrays import Arrays, checked
from odom.registration.measurement_covariance import bad_covariance, precisions
from odom.registration.pairs import Pairs, Prior, Registration, degenerate
from odom.registration.result import NoiseScale, registration_of
from odom.registration.solution import Solution, solve
from odom.registration.weighted_horn import weighted_horn


def kalman(pairs: Pairs, prior: Prior | None = None) -> Registration:
    """Return the motion of `pairs` by the Kalman filter (eqs. 11-16, with Q = 0 in eq. 13) in information form.

    Corrected against the paper: H_k is built from q, not p; R_k holds variances, not standard deviations, and the
    source's noise (`S_k = Sp + R Sq R'`), which is allowed for in H_k, too (`allow_for_source_noise`); the joint state
    needs no centroids; there is no P_0 = Q, which would be a strong prior on the identity; and the projection onto
    SE(3) is weighted by the information.
    The verdict is DEGENERATE for fewer than 3 pairs and points on a line, unless a prior with covariance makes up for
    them. Errors as for `register`.
    """
    arrays = checked(pairs)
    n = len(arrays.q)
    if (none := too_few(n, prior)) is not None:
        return none
    solution = solve_ungated(arrays, prior)
    return registration_of(arrays, prior, solution, NoiseScale(variance_factor=solution.variance_factor))


def too_few(n: int, prior: Prior | None) -> Registration | None:
    """Return the result that has no motion for fewer than 3 pairs, None for 3 or where a prior makes up for them."""
    least = 3 if prior is None or prior.covariance is None else 1
    return degenerate(n, f"{n} pairs: at least {least} {'are' if least > 1 else 'is'} needed") if n < least else None


def solve_ungated(arrays: Arrays, prior: Prior | None, alpha: float = 0.0) -> Solution:
    """Return the solution of all pairs, S_k linearised first at the prior, without one at Horn's weighted motion."""
    if prior is not None:
        return solve(arrays, prior, prior.T_target_source, arrays.weights, alpha=alpha)
    T = horn_start(arrays) if len(arrays.Sq) > 0 else np.eye(4)
    return solve(arrays, prior, T, arrays.weights, alpha=alpha)


def horn_start(arrays: Arrays) -> Array:
    """Return Horn's motion (4 x 4) weighted by the mean variances of S_k, where R of S_k may begin without a prior.

    Raises InputError for a covariance that is not positive definite.
    """
    T, W = np.eye(4), np.empty((len(arrays.q), 8))
    bad = precisions(arrays.Sq, arrays.Sp, T, 0.0, W)
    if bad >= 0:
        raise bad_covariance(bad)
    weighted_horn(arrays.q, arrays.p, W, arrays.weights, T)
    return T
