"""The recursion in information form over a block of pairs, and its weighted projection onto SE(3)."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from odom.registration.kernels import accumulate, mahalanobis, precisions, project, unpack

Array = NDArray[np.float64]


@compiled
def finite(values: Array) -> bool:
    """Return whether all n x 3 values are finite."""
    total = 0.0
    for k in range(len(values)):
        total += 0.0 * (values[k, 0] + values[k, 1] + values[k, 2])
    return total == 0.0


@compiled
def usable(base: Array) -> bool:
    """Return whether all n weights are finite and not negative."""
    total = 0.0
    for k in range(len(base)):
        total += 0.0 * np.sqrt(base[k])
    return total == 0.0


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
) -> int:
    """Run the recursion over all pairs with `g` > 0 and project onto SE(3), `rounds` times.

    Each round takes the R of `S_k` from the one before.     `T` holds the linearisation on entry, the motion on
    return; `Y0` (6 x 6 or empty) and `T0` are the prior. With a finite `bound` the pairs within it have their weight
    `base` in the next round. `W`, `Y` (12 x 12), `y` (12), `H` (6 x 6) and `chi2` are output. Returns 0, 1 + k when
    the covariance of pair k cannot be used, or -1 when the motion is not determined.
    """
    for _ in range(rounds):
        bad = precisions(Sq, Sp, T, alpha, W)
        if bad >= 0:
            return 1 + bad
        A = np.zeros((6, 10))
        for i in range(12):
            y[i] = 0.0
        accumulate(q, p, W, g, A, y)
        unpack(A, Y)
        if project(Y, y, Y0, T0, T, H) == 0:
            return -1
        mahalanobis(q, p, W, T, chi2)
        if bound < np.inf:
            changed = 0
            for k in range(len(q)):
                now = base[k] if chi2[k] <= bound else 0.0
                changed += now != g[k]
                g[k] = now
            if changed == 0:
                break
    return 0
