"""WICP and EM-ICP: with the correspondences given, or finding them by a k-d tree as they are meant to."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from odom.geometry.arrays import Array
from odom.registration.checked_arrays import finite
from odom.registration.gate import BOUND
from odom.registration.measurement_covariance import bad_covariance
from odom.registration.pairs import Pairs, Prior, Registration, degenerate
from odom.registration.paper.closed_form import closed_form, least_squares_result, too_few
from odom.registration.paper.tuning import TUNING

_MAX_ROUNDS = 100
"""Bound of the iterations; all clouds of the benchmark need less than half of it."""


class _Clouds(NamedTuple):
    """Points (n x 3, m), one variance for each (n, m^2), and the weights of the pairs (n)."""

    q: Array
    p: Array
    variance_q: Array
    variance_p: Array
    given: Array


def _clouds(pairs: Pairs, matched: bool) -> _Clouds:
    """Return the points with the mean variance of their axes; 0.5 where no side has covariances.

    Raises InputError as `horn` does, and for a variance that is negative or not finite, or 0 on both sides of a pair,
    or of points that could become one.
    """
    arrays = finite(pairs)

    def variance(covariances: Array | None, other: Array | None) -> Array:
        if covariances is not None:
            axes = np.einsum("nii->ni", covariances)
            return np.where((axes >= 0.0).all(axis=1), np.einsum("nii->n", covariances) / 3.0, np.nan)
        return np.full(len(pairs), 0.5 if other is None else 0.0)

    source, target = pairs.covariances_source, pairs.covariances_target
    of_q, of_p = variance(source, target), variance(target, source)
    total = of_q + of_p
    bad = np.flatnonzero(~(np.isfinite(total) & (total > 0.0)))
    if len(bad) == 0 and len(pairs) > 0 and not matched:
        bad = np.flatnonzero(of_q + of_p.min() <= 0.0)
    if len(bad) > 0:
        raise bad_covariance(int(bad[0]))
    return _Clouds(arrays.q, arrays.p, of_q, of_p, arrays.weights)


def wicp(pairs: Pairs, prior: Prior | None = None, *, matched: bool = True) -> Registration:
    """Return the motion by weighted ICP (C. Dorai et al., PAMI 19, 1997): weights are inverse mean variances.

    `matched`: pair k belongs together. Otherwise source and target are clouds in any order, each source point is
    paired with the nearest target anew in every round, from the prior or the identity; pairs beyond some times the
    median distance are left out. Verdicts and errors as for `horn`, and InputError for variances that are not positive.
    """
    clouds = _clouds(pairs, matched)
    if (none := too_few(clouds.given)) is not None:
        return none
    if matched:
        weights = clouds.given / (clouds.variance_q + clouds.variance_p)
        T = closed_form(clouds.q, clouds.p, weights)
        return least_squares_result(clouds.q, clouds.p, weights, T, {"rounds": 1.0})
    tree = KDTree(clouds.p)
    T = np.eye(4) if prior is None else prior.T_target_source
    match = np.full(len(pairs), -1)
    rounds = 0
    while rounds < _MAX_ROUNDS:
        rounds += 1
        distance, nearest = _nearest(tree, clouds.q @ T[:3, :3].T + T[:3, 3], 1)
        kept = distance <= TUNING.wicp_medians * np.median(distance[clouds.given > 0.0]) + 1e-12
        weights = np.where(kept, clouds.given / (clouds.variance_q + clouds.variance_p[nearest]), 0.0)
        T = closed_form(clouds.q, clouds.p[nearest], weights)
        if (nearest == match).all():
            break
        match = nearest
    return least_squares_result(clouds.q, clouds.p[nearest], weights, T, {"rounds": float(rounds)})


def em_icp(pairs: Pairs, prior: Prior | None = None, *, matched: bool = True) -> Registration:
    """Return the motion by EM-ICP (S. Granger and X. Pennec, ECCV 2002): correspondences are probabilities.

    E: the probability of each match under isotropic noise of the points' variances times a common factor; M: the
    closed form for the expected matches. `matched`: pair k belongs together or is wrong, an even density over the
    target's box, which is some sigmas wide at least. Otherwise each source point is shared among its nearest targets,
    the factor annealed from the size of the clouds down to the noise; it starts at the prior or the identity. Verdicts
    and errors as for `wicp`.
    """
    clouds = _clouds(pairs, matched)
    if (none := too_few(clouds.given)) is not None:
        return none
    return _em_matched(clouds) if matched else _em_clouds(clouds, prior)


def _nearest(tree: KDTree, points: Array, k: int) -> tuple[Array, NDArray[np.intp]]:
    """Return distances and indices of the nearest k points of the tree: n, or n x k for k > 1."""
    distance, index = tree.query(points, k=k)
    return np.asarray(distance), np.asarray(index)


def _em_matched(clouds: _Clouds) -> Registration:
    """EM over given pairs: a Gaussian of `factor` times the variances, against an even density of wrong ones."""
    variance = clouds.variance_q + clouds.variance_p
    wrong = TUNING.em_outlier_share
    sides = np.maximum(np.ptp(clouds.p, axis=0), 2.0 * np.sqrt(BOUND * np.median(variance)))
    even = wrong / float(np.prod(sides))
    T = closed_form(clouds.q, clouds.p, clouds.given / variance)
    factor = -1.0
    rounds = 0
    while rounds < _MAX_ROUNDS:
        rounds += 1
        squares = ((clouds.p - clouds.q @ T[:3, :3].T - T[:3, 3]) ** 2).sum(axis=1) / variance
        if factor < 0.0:
            factor = max(float(squares.mean()) / 3.0, 1e-12)
        density = (1.0 - wrong) * np.exp(-0.5 * squares / factor) / (2.0 * np.pi * factor * variance) ** 1.5
        right = density / (density + even)
        weights = clouds.given * right / variance
        if np.count_nonzero(weights > 1e-12) < 3:
            return degenerate(len(clouds.q), "no pair is probable")
        previous, T = T, closed_form(clouds.q, clouds.p, weights)
        factor = max(float(right @ squares / right.sum()) / 3.0, 1e-12)
        if np.abs(T - previous).max() < 1e-10:
            break
    weights = np.where(right > 0.5, weights, 0.0)
    return least_squares_result(clouds.q, clouds.p, weights, T, {"rounds": float(rounds)})


def _em_clouds(clouds: _Clouds, prior: Prior | None) -> Registration:
    """EM over clouds in any order: each source point has an expected target among its nearest ones."""
    k = min(TUNING.em_neighbours, len(clouds.p))
    tree = KDTree(clouds.p)
    T = np.eye(4) if prior is None else prior.T_target_source
    noise = float(np.median(clouds.variance_q) + np.median(clouds.variance_p))
    distance, _ = _nearest(tree, clouds.q @ T[:3, :3].T + T[:3, 3], 1)
    factor = max(float(np.mean(distance**2)) / (3.0 * noise), 1.0)
    rounds = 0
    while rounds < _MAX_ROUNDS:
        rounds += 1
        distance, nearest = _nearest(tree, clouds.q @ T[:3, :3].T + T[:3, 3], k)
        variance = factor * (clouds.variance_q[:, None] + clouds.variance_p[nearest])
        exponent = -0.5 * distance**2 / variance - 1.5 * np.log(variance)
        share = np.exp(exponent - exponent.max(axis=1, keepdims=True))
        share /= share.sum(axis=1, keepdims=True)
        precision = share / variance
        total = precision.sum(axis=1)
        expected = np.einsum("nk,nki->ni", precision, clouds.p[nearest]) / total[:, None]
        weights = np.where(distance[:, 0] ** 2 < BOUND * variance[:, 0], clouds.given * total, 0.0)
        if np.count_nonzero(weights) < 3:
            return degenerate(len(clouds.q), "no pair is probable")
        previous, T = T, closed_form(clouds.q, expected, weights)
        if factor == 1.0 and np.abs(T - previous).max() < 1e-9:
            break
        factor = max(TUNING.em_annealing * factor, 1.0)
    return least_squares_result(clouds.q, expected, weights, T, {"rounds": float(rounds)})
