"""Scale on request: eq. (4), around any estimator."""

from dataclasses import replace

import numpy as np

from odom.geometry.arrays import Array
from odom.registration.pairs import Estimator, Pairs, Prior, Registration

_MAX_ROUNDS = 20
"""Bound of the iterations; half as many do for a scale to ten digits."""


def with_scale(estimator: Estimator) -> Estimator:
    """Return the estimator that also finds the scale s of `p = s R q + t`, as `Registration.scale`.

    Eq. (4) sums ratios, which noise near the centroid ruins; here it is the ratio of sums, `s = sum w p' R q / sum w
    |R q|^2` about the (weighted) centroids, corrected for the source's noise: `sum w |R q|^2` is too large by
    `sum w tr Sq`, where that is stated. `T_target_source` and its covariance are of the source points times the
    scale; the covariance allows for the scale's own error. `estimator` takes pairs that belong together, as each does
    by default: of clouds in any order (`matched=False`) no scale is found.
    """

    def estimate(pairs: Pairs, prior: Prior | None = None) -> Registration:
        scale = _spread(pairs.points_target) / max(_spread(pairs.points_source), 1e-300)
        if not 0.0 < scale < np.inf:
            scale = 1.0  # the estimator says what is wrong
        for _ in range(_MAX_ROUNDS):
            C = pairs.covariances_source
            points, covariances = scale * pairs.points_source, None if C is None else scale**2 * C
            scaled = replace(pairs, points_source=points, covariances_source=covariances)
            result = estimator(scaled, prior)
            if not result.ok:
                return result
            used = result.inliers
            w = _weights(scaled)[used]
            w /= w.sum()
            q = scaled.points_source[used] @ result.T_target_source[:3, :3].T
            p = scaled.points_target[used]
            q, p = q - w @ q, p - w @ p
            noise = 0.0 if covariances is None else w @ np.einsum("nii->n", covariances[used])
            # eq. (4), corrected: at the scale sought, of step 1, sum w p'Rq is less than sum w |Rq|^2 by the noise
            step = float((np.einsum("n,ni,ni->", w, p, q) + noise) / np.einsum("n,ni,ni->", w, q, q))
            result = replace(result, scale=scale)
            if abs(step - 1.0) < 1e-10:
                break
            scale *= step
        return replace(result, covariance=result.covariance + _of_scale(scaled, result))

    return estimate


def _spread(points: Array) -> float:
    """Return the median distance of points from their median: a guess of scale that wrong pairs do not spoil."""
    if len(points) == 0:
        return 0.0
    return float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))


def _of_scale(pairs: Pairs, result: Registration) -> Array:
    """Return what the scale's error adds to the covariance (6 x 6): `b var(log s) b'`, with b = d xi / d log s.

    A larger scale moves the centroid away, `b = (-mean q, 0)`; `var(log s) = 1 / sum w |q|^2` about it.
    """
    used = result.inliers
    q, w = pairs.points_source[used], _weights(pairs)[used]
    mean = w @ q / w.sum()
    is_noise_stated = pairs.covariances_source is not None or pairs.covariances_target is not None
    noise = max(1.0, result.variance_factor) if is_noise_stated else result.variance_factor
    b = np.concatenate([-mean, np.zeros(3)])
    return np.asarray(np.outer(b, b) * noise / (w @ np.square(q - mean).sum(axis=1)))


def _weights(pairs: Pairs) -> Array:
    """Return the weight of each pair: the given one over its mean variance, where that is known."""
    given = np.ones(len(pairs)) if pairs.weights is None else pairs.weights.copy()
    variance = np.zeros(len(pairs))
    for C in (pairs.covariances_source, pairs.covariances_target):
        if C is not None:
            variance += np.einsum("nii->n", C) / 3.0
    return np.asarray(given / variance if variance.any() else given)
