"""The H-infinity term of the recursion, and how far the twelve states are from a rigid motion."""

import math

import numpy as np

from odom.errors import InputError
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.linear_algebra import cholesky_solve


def check_settings(theta: float, alpha: float) -> None:
    """Raise InputError unless `theta` = 1 / gamma and `alpha` make a filter: finite, and not negative."""
    if not (0.0 <= theta < math.inf and 0.0 <= alpha < math.inf):
        raise InputError(f"theta = {theta}, alpha = {alpha}: give finite values, not negative")


@compiled
def affine_misfit(Y: Array, y: Array, T: Array) -> float:
    """Return the squared distance, in sigmas, of the twelve states `inv(Y) y` from the rigid motion `T`.

    Chi-square with 6 degrees of freedom if all is well: the recursion estimates an affine map, and a true one is
    rigid. 0 when Y is singular: too few directions seen.
    """
    m = len(y)
    x = np.empty(m)
    if not cholesky_solve(Y.copy(), y, x):
        return 0.0
    total = 0.0
    for i in range(m):
        for j in range(m):
            total += (x[i] - T[i // 4, i % 4]) * Y[i, j] * (x[j] - T[j // 4, j % 4])
    return total


@compiled
def discount(Y: Array, y: Array, H: Array, steps: int, theta: float) -> tuple[float, int]:
    """Take the H-infinity term of `steps` steps out of the information in place; the estimate stays where it is.

    A step of Hung and Yang's filter has `Y+ = Y - theta^2 L'L + C'inv(S_k) C`; with L = I (12) the terms add up to
    `steps theta^2`, and `H -= steps theta^2 B'B`. From y theirs takes theta^2 times the estimate of each step; here all
    are taken at the last one, `y -= steps theta^2 x`, so that theta changes the covariance alone, whatever the order of
    the pairs. Of 100 pairs with a noise of 5 cm the estimates differ by 2e-4 sigma at theta = .1, by .5 sigma at 5. The
    filter exists where `Y - steps theta^2 I` is positive; theta is halved until `steps theta^2 < lmin(Y) / 2`. Returns
    the theta used and how often it was halved, zeros when Y is singular: too few directions seen.
    """
    m = len(y)
    L, x, unused = Y.copy(), np.empty(m), np.empty(m)
    if not cholesky_solve(L, y, x):
        return 0.0, 0
    for halvings in range(60):
        term = steps * theta * theta
        for i in range(m):
            for j in range(m):
                L[i, j] = 0.5 * Y[i, j]
            L[i, i] -= term
        if cholesky_solve(L, y, unused):
            for i in range(m):
                Y[i, i] -= term
                y[i] -= term * x[i]
            for i in range(3):  # B'B = diag(1, 1, 1, 2, 2, 2)
                H[i, i] -= term
                H[3 + i, 3 + i] -= 2.0 * term
            return theta, halvings
        theta *= 0.5
    return 0.0, 0
