"""The recursion in information form over a block of pairs, and its weighted projection onto SE(3)."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from odom.registration.kernels import accumulate, precisions, unpack
from odom.registration.linear import cholesky_solve
from odom.registration.motion import horn, rotation_of
from odom.registration.projection import project

Array = NDArray[np.float64]


@compiled
def unusable(q: Array, p: Array, weights: Array) -> int:
    """Return 0, or 1 when points (n x 3 each) are not all finite, 2 when weights (n) are not finite and at least 0."""
    points = total = 0.0
    for k in range(len(q)):
        points += 0.0 * (q[k, 0] + q[k, 1] + q[k, 2] + p[k, 0] + p[k, 1] + p[k, 2])
        total += 0.0 * np.sqrt(weights[k])
    return 1 if points != 0.0 else 2 if total != 0.0 else 0


@compiled
def affine_start(Y: Array, y: Array, T: Array) -> bool:
    """Set `T` to the rigid motion nearest to the linear estimate `inv(Y) y`; False when that is not determined."""
    x = np.empty(12)
    if not cholesky_solve(Y.copy(), y, x):
        return False
    rotation_of(x[0], x[4], x[8], x[1], x[5], x[9], x[2], x[6], x[10], T)
    for i in range(3):
        T[i, 3] = x[4 * i + 3]
    return True


@compiled
def statistics(q: Array, p: Array, W: Array, g: Array, T: Array, chi2: Array, sums: Array) -> None:
    """Fill `chi2` (n), and `sums` with (number, sum chi2, sum chi2^2, sum u_i^2 / W_ii a target axis i).

    Summed are pairs with `g` > 0; `u = W (p - R q - t)`: each axis' share has expectation 1 where the covariance is
    true, whatever the other axes do.
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
    q: Array,
    p: Array,
    Sq: Array,
    Sp: Array,
    base: Array,
    Y0: Array,
    T0: Array,
    alpha: float,
    bound: float,
    rounds: int,
    T: Array,
    g: Array,
    W: Array,
    Y: Array,
    y: Array,
    H: Array,
    chi2: Array,
    sums: Array,
) -> int:
    """Run the recursion over all pairs with `g` > 0 and project onto SE(3), `rounds` times.

    Each round takes the R of `S_k` from the one before. `T` holds the linearisation on entry (not looked at
    without `Sq`), the motion on return; `Y0` (6 x 6 or empty) and `T0` are the prior. With a finite `bound` the pairs
    within it have their weight `base` in the next round. `W`, `Y` (12 x 12), `y` (12), `H` (6 x 6) and `chi2` are
    output. Returns 0, 1 + k when the covariance of pair k cannot be used, or -1 when the motion is not determined.
    """
    free = len(Sq) == 0  # S_k needs no R: the linear estimate is where the projection begins
    for _ in range(rounds):
        bad = precisions(Sq, Sp, T, alpha, W)
        if bad >= 0:
            return 1 + bad
        A = np.zeros((6, 10))
        for i in range(12):
            y[i] = 0.0
        accumulate(q, p, W, g, A, y)
        unpack(A, Y)
        if free and not affine_start(Y, y, T):
            horn(q, p, W, g, T)
        free = False
        if project(Y, y, Y0, T0, T, H) == 0:
            return -1
        statistics(q, p, W, g, T, chi2, sums)
        if bound < np.inf:
            changed = 0
            for k in range(len(q)):
                now = base[k] if chi2[k] <= bound else 0.0
                changed += now != g[k]
                g[k] = now
            if changed == 0:
                break
    return 0


@compiled
def affine_misfit(Y: Array, y: Array, T: Array) -> float:
    """Return the squared distance, in sigmas, of the twelve states `inv(Y) y` from the rigid motion `T`.

    Chi-square with 6 degrees of freedom if all is well: the recursion estimates an affine map, and a true one is
    rigid. 0 when Y is singular: too few directions seen.
    """
    m = len(y)
    L = Y.copy()
    x = np.empty(m)
    if not cholesky_solve(L, y, x):
        return 0.0
    total = 0.0
    for i in range(m):
        for j in range(m):
            total += (x[i] - T[i // 4, i % 4]) * Y[i, j] * (x[j] - T[j // 4, j % 4])
    return total


@compiled
def discount(Y: Array, y: Array, H: Array, steps: int, theta: float) -> tuple[float, int]:
    """Take the H-infinity term of `steps` steps out of the information in place, the estimate staying where it is.

    `Y+ = Y - theta^2 L'L`, `y+ = y - theta^2 L'L x` with L = I (12), and so `H -= theta^2 B'B`, where `steps theta^2
    < lmin(Y) / 2` lets the filter exist: theta is halved until it does. Returns the theta used and how often it was
    halved, zeros when Y is singular: too few directions seen.
    """
    m = len(y)
    L = np.empty((m, m))
    x = np.empty(m)
    for i in range(m):
        for j in range(m):
            L[i, j] = Y[i, j]
    if not cholesky_solve(L, y, x):
        return 0.0, 0
    unused = np.empty(m)
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
