"""Truncated least squares by graduated non-convexity: the motion that many pairs agree on, without a first guess.

H. Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020 (GNC-TLS): the cost of a
pair is min(chi2, bound); its convex surrogate of parameter mu approaches it as mu grows. Here each pair has its own
covariance.
"""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.checked_arrays import Arrays
from odom.registration.measurement_covariance import mahalanobis, precisions
from odom.registration.pair_information import accumulate, information_matrix
from odom.registration.weighted_horn import weighted_horn
from odom.registration.weighted_projection import project_onto_se3


class Schedule(NamedTuple):
    """How mu goes on: the share of the pairs for which it begins convex, and its growth; see `Tuning`.

    From `full_mu` on full covariances are used; they are computed again after a turn whose cosine is below
    `turn_cosine`.
    """

    begin_share: float
    growth: float
    full_mu: float
    turn_cosine: float


@compiled
def turned(R: Array, T: Array, turn_cosine: float) -> bool:
    """Return whether the angle between the rotations of `R` and `T` has a cosine below `turn_cosine`."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += R[i, j] * T[i, j]
    return bool(0.5 * (trace - 1.0) < turn_cosine)


@compiled
def initial_mu(chi2: Array, given: Array, bound: float, share: float, growth: float) -> float:
    """Return the mu at which the surrogate is convex for a `share` of the pairs, where GNC-TLS begins.

    `mu = bound / (2 r - bound)`, r the largest squared residual; r is found by steps of `growth`.
    """
    used = 0
    for k in range(len(chi2)):
        used += given[k] > 0.0
    reach = bound
    inside = 0
    while reach < 1e12 and inside < share * used:
        reach *= growth
        inside = 0
        for k in range(len(chi2)):
            inside += given[k] > 0.0 and chi2[k] <= reach
    return bound / (2.0 * reach - bound)


@compiled
def graduate(arrays: Arrays, T: Array, near: bool, bound: float, schedule: Schedule, W: Array, chi2: Array) -> int:
    """Move `T` to a minimum of the truncated least squares of the pairs with weight > 0; fill `W` and `chi2`.

    `near`: `T` is a prediction, and the first weights come from its residuals; otherwise all pairs begin with their
    whole weight. Returns the number of rounds, or -1 - k if the covariance of pair k is not positive.
    """
    q, p, Sq, Sp, given = arrays
    begin_share, growth, full_mu, turn_cosine = schedule
    n = len(q)
    empty = np.empty((0, 0))
    Y = np.empty((12, 12))
    H = np.empty((6, 6))
    R = np.empty((3, 3))
    g = given.copy()
    mu = -1.0
    for round_ in range(1, 101):  # mu has passed 50 by then
        # S_k = Sp + R Sq R', anew only where R has turned
        if round_ == 1 or turned(R, T, turn_cosine):
            for i in range(3):
                for j in range(3):
                    R[i, j] = T[i, j]
            bad = precisions(Sq, Sp, R, 0.0, W)
            if bad >= 0:
                return -1 - bad
        # variable update: the motion of the pairs as weighted now; in early rounds scalar weights will do
        if round_ > 1 or not near:
            fine = False
            if mu > full_mu:
                A = np.zeros((6, 10))
                y = np.zeros(12)
                accumulate(q, p, W, g, A, y)
                information_matrix(A, Y)
                fine = project_onto_se3(Y, y, empty, T, T, H) > 0
            if not fine and not weighted_horn(q, p, W, g, T) > 0.0:
                return round_
        mahalanobis(q, p, W, T, chi2)
        if mu < 0.0:
            mu = initial_mu(chi2, given, bound, begin_share if near else 1.0, growth)
        else:
            mu *= growth
        # weight update: out, in, or in between
        lower, upper = mu / (mu + 1.0) * bound, (mu + 1.0) / mu * bound
        undecided = 0
        for k in range(n):
            if not chi2[k] < upper:
                g[k] = 0.0
            elif chi2[k] <= lower:
                g[k] = given[k]
            else:
                undecided += given[k] > 0.0
                g[k] = given[k] * (np.sqrt(bound * mu * (mu + 1.0) / chi2[k]) - mu)
        # done when no pair is in between; at mu = 50 that is only 2 % on either side of the bound
        if (undecided == 0 and mu > 0.5) or mu > 50.0:
            break
    return round_
