"""Horn's closed form: the least-squares motion of pairs that are all equally good."""

import numpy as np

from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.rotations import turn_onto
from odom.registration.checked_arrays import finite
from odom.registration.pairs import Pairs, Prior, Registration, Verdict, degenerate


def closed_form(q: Array, p: Array, weights: Array | None = None) -> Array:
    """Return the motion (4 x 4) of least weighted squares that maps `q` onto `p` (n x 3 each): eqs. (2), (4), (6).

    B. Horn, J. Opt. Soc. Am. A 4, 1987; the rotation by singular value decomposition: K. Arun et al., PAMI 9, 1987.
    """
    if weights is None:
        q_mean, p_mean = q.mean(axis=0), p.mean(axis=0)
        weighted = p - p_mean
    else:
        total = weights.sum()
        q_mean, p_mean = weights @ q / total, weights @ p / total
        weighted = (p - p_mean) * weights[:, None]
    T = np.eye(4)
    T[:3, :3] = turn_onto(q - q_mean, weighted)
    T[:3, 3] = p_mean - T[:3, :3] @ q_mean  # eq. (4)
    return T


def too_few(weights: Array) -> Registration | None:
    """Return the result that has no motion where fewer than 3 of n pairs have weight (n), None where more have."""
    n, used = len(weights), int(np.count_nonzero(weights))
    if n < 3:
        return degenerate(n, f"{n} pairs: at least 3 are needed")
    return degenerate(n, f"{used} pairs of {n} have weight: at least 3 are needed") if used < 3 else None


def least_squares_result(q: Array, p: Array, weights: Array, T: Array, details: dict[str, float]) -> Registration:
    """Return the result of a (weighted) least-squares motion, its noise judged by its own residuals.

    The covariance is that of isotropic noise of variance `s / weight`, s from the residuals: `s inv(sum w J'J)`, `J =
    [I, -hat(q)]`. `chi2` is against it.
    """
    n = len(q)
    used = weights > 0.0
    count = int(np.count_nonzero(used))
    if count < 3:
        return degenerate(n, f"{count} pairs of {n} can be used: at least 3 are needed", inliers=used)
    R = T[:3, :3]
    squares = weights * ((p - q @ R.T - T[:3, 3]) ** 2).sum(axis=1)
    s = float(squares.sum()) / (3 * count - 6)
    total = float(weights.sum())
    mean = weights @ q / total
    centred = q - mean
    scatter = (centred * weights[:, None]).T @ centred
    spread = np.linalg.eigvalsh(scatter)
    if spread[1] <= max(1e-9 * spread[2], 2.0 / 3.0 * s * count):  # the residuals' own share of a flat direction
        return degenerate(n, f"{count} points lie on a line or in one place, within their noise", inliers=used)
    information = np.zeros((6, 6))
    information[:3, :3] = total * np.eye(3)
    mean_hat = se3.hat(mean)
    information[:3, 3:] = -total * mean_hat
    information[3:, :3] = information[:3, 3:].T
    information[3:, 3:] = np.trace(scatter) * np.eye(3) - scatter - total * mean_hat @ mean_hat
    # about the centroid, rotations measured by the spread of the points (as `conditioning.assess` does)
    inner = np.trace(scatter) - spread
    turned = np.concatenate([np.full(3, total), inner / (float(np.trace(scatter)) / total)])
    return Registration(
        T,
        np.asarray(s * np.linalg.inv(information), dtype=np.float64),
        used,
        squares / s if s > 0.0 else np.zeros(n),
        float(turned.min() / turned.max()),
        Verdict.OK,
        variance_factor=s,
        details=details,
    )


def horn(pairs: Pairs, prior: Prior | None = None) -> Registration:
    """Return Horn's motion of `pairs`: covariances are not looked at, nor the prior; `weights` are.

    Verdict DEGENERATE for fewer than 3 pairs and points on a line; InputError for values that are not finite.
    """
    arrays = finite(pairs)
    if (none := too_few(arrays.weights)) is not None:
        return none
    T = closed_form(arrays.q, arrays.p, pairs.weights)
    return least_squares_result(arrays.q, arrays.p, arrays.weights, T, {})
