"""The recursion in information form over a block of pairs, and its weighted projection onto SE(3).

With A = I and no process noise (one motion between two frames) eqs. (11)-(16) and (22)-(28) become a sum over pairs
that does not depend on their order: `Y+ = Y + C'inv(S_k) C`, `Y+ x+ = Y x + C'inv(S_k) p`.
"""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.checked_arrays import Arrays
from odom.registration.linear_algebra import cholesky_solve
from odom.registration.measurement_covariance import precisions
from odom.registration.pair_information import accumulate, allow_for_source_noise, information_matrix
from odom.registration.weighted_horn import rotation_of, weighted_horn
from odom.registration.weighted_projection import project_onto_se3


class Output(NamedTuple):
    """What `recurse` fills: `W` (n x 8), `Y` (12 x 12), `y` (12), `H` (6 x 6), `chi2` (n), and `sums` (6)."""

    W: Array
    Y: Array
    y: Array
    H: Array
    chi2: Array
    sums: Array


@compiled
def affine_start(Y: Array, y: Array, T: Array) -> bool:
    """Set `T` to the rigid motion nearest to the linear estimate `inv(Y) y`; False when that is not determined."""
    x = np.empty(12)
    if not cholesky_solve(Y.copy(), y, x):
        return False
    M = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            M[i, j] = x[4 * j + i]
    rotation_of(M, T)
    for i in range(3):
        T[i, 3] = x[4 * i + 3]
    return True


@compiled
def statistics(q: Array, p: Array, W: Array, g: Array, T: Array, chi2: Array, sums: Array) -> None:
    """Fill `chi2` (n), and `sums` with (number, sum chi2, sum chi2^2, sum u_i^2 / W_ii of target axis i = 1, 2, 3).

    `chi2 = e'W e` with e = p - (R q + t), `u = W e`. The sums are over pairs with `g` > 0. Where the covariances are
    true, u_i^2 / W_ii has expectation 1, whatever the other axes do.
    """
    for i in range(6):
        sums[i] = 0.0
    for k in range(len(q)):
        x, y, z = q[k, 0], q[k, 1], q[k, 2]
        a = p[k, 0] - (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3])
        b = p[k, 1] - (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3])
        c = p[k, 2] - (T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3])
        u = W[k, 0] * a + W[k, 1] * b + W[k, 2] * c
        v = W[k, 1] * a + W[k, 3] * b + W[k, 4] * c
        w = W[k, 2] * a + W[k, 4] * b + W[k, 5] * c
        e = u * a + v * b + w * c
        chi2[k] = e
        if not g[k] > 0.0:
            continue
        sums[0] += 1.0
        sums[1] += e
        sums[2] += e * e
        sums[3] += u * u / W[k, 0]
        sums[4] += v * v / W[k, 3]
        sums[5] += w * w / W[k, 5]


@compiled
def recurse(
    arrays: Arrays,
    prior: tuple[Array, Array],
    alpha: float,
    bound: float,
    rounds: int,
    T: Array,
    g: Array,
    output: Output,
) -> int:
    """Run the recursion over all pairs with `g` > 0 and project onto SE(3), `rounds` times; fill `output`.

    Each round takes the R of `S_k`, and of what allows for the source's noise in `Y`, from the one before. `T` holds
    the linearisation on entry (not looked at without `Sq`), the motion on return; `prior` is its information (6 x 6 or
    empty) and the motion it lies at. With a finite `bound` the pairs within it have their given weight in the next
    round. Returns 0, 1 + k when the covariance of pair k cannot be used, or -1 when the motion is not determined.
    """
    q, p, Sq, Sp, given = arrays
    Y0, T0 = prior
    W, Y, y, H, chi2, sums = output
    free = len(Sq) == 0  # S_k needs no R: the linear estimate is where the projection begins
    for _ in range(rounds):
        # Y = sum C'inv(S_k) C, y = sum C'inv(S_k) p
        bad = precisions(Sq, Sp, T, alpha, W)
        if bad >= 0:
            return 1 + bad
        A = np.zeros((6, 10))
        for i in range(12):
            y[i] = 0.0
        accumulate(q, p, W, g, A, y)
        information_matrix(A, Y)
        # the rigid motion nearest to inv(Y) y in the metric of Y
        if free and not affine_start(Y, y, T):
            weighted_horn(q, p, W, g, T)
        free = False
        allowed = y.copy()
        allow_for_source_noise(Sq, T, W, g, allowed)
        if project_onto_se3(Y, allowed, Y0, T0, T, H) == 0:
            return -1
        # which pairs count in the next round
        statistics(q, p, W, g, T, chi2, sums)
        if bound < np.inf:
            changed = 0
            for k in range(len(q)):
                now = given[k] if chi2[k] <= bound else 0.0
                changed += now != g[k]
                g[k] = now
            if changed == 0:
                break
    return 0
