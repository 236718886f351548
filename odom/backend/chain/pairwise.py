"""One frame registered against another: wrong pairs are gated out, then the robust recursion in measured coordinates.

A pair with depth in both frames gives three rows, one with depth in only one of them gives two: so a frame without any
depth can be registered, too, by the depth of the other one.
"""

from dataclasses import dataclass

import numpy as np

from odom.backend.chain.shared_errors import gains_of
from odom.backend.chain.tuning import TUNING
from odom.backend.tracking.pose_solver import fit_pose
from odom.frontend.features.measurement import Measurements, points_of
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.registration import Pairs, Prior, register


@dataclass(frozen=True, eq=False)
class PairwisePose:
    """The pose `T_previous_current`, its 6 x 6 covariance (`se3`), and which of the n pairs agree with it.

    `of_previous` and `of_current` (n x 6 x 3) are the derivatives of the pose by errors of the two frames' `values`
    (see `shared_errors`).
    """

    T_previous_current: Array
    covariance: Array
    inliers: Mask
    of_previous: Array
    of_current: Array


def register_frames(previous: Measurements, current: Measurements, T_hint: Array) -> PairwisePose | str:
    """Register two frames by n features that both measured; `T_hint` is the expected T_previous_current.

    Returns a reason where there is no pose. The frame with more depth gives the points, the other one the measurements.
    """
    deep_previous, deep_current = previous.values[:, 2] > 0.0, current.values[:, 2] > 0.0
    if np.count_nonzero(deep_previous) >= np.count_nonzero(deep_current):
        return _of_points(previous, current, deep_previous, T_hint)
    found = _of_points(current, previous, deep_current, se3.inverse(T_hint))
    if isinstance(found, str):
        return found
    T_current_previous = found.T_previous_current
    covariance = se3.inverse_covariance(T_current_previous, found.covariance)
    turned = -se3.adjoint(T_current_previous)
    of_previous, of_current = turned @ found.of_current, turned @ found.of_previous
    return PairwisePose(se3.inverse(T_current_previous), covariance, found.inliers, of_previous, of_current)


def _of_points(source: Measurements, target: Measurements, deep: Mask, T_hint: Array) -> PairwisePose | str:
    """Return T_source_target from the source's points where it measured depth (`deep`), and their images in the target.

    With S = Sp + P Sq P', the source's noise carried into the target's coordinates (see `fit_pose`).
    """
    rows = np.flatnonzero(deep)
    if len(rows) < TUNING.chain_least_pairs:
        return f"{len(rows)} features in common with depth"
    source, target = source.take(rows), target.take(rows)
    points, covariances = points_of(source)
    T_target_source, used = se3.inverse(T_hint), np.ones(len(rows), dtype=np.bool_)
    both = np.flatnonzero(target.values[:, 2] > 0.0)
    is_gated = len(both) >= TUNING.gated_pairs
    if is_gated:
        points_target, covariances_target = points_of(target.take(both))
        pairs = Pairs(points_target, points[both], covariances_target, covariances[both])
        gated = register(pairs, Prior(T_hint))
        if not gated.ok:
            return gated.reason
        used[both], T_target_source = gated.inliers, se3.inverse(gated.T_target_source)
    fit = fit_pose(points, covariances, target.values, target.covariance, T_target_source, used)
    fit = fit_pose(points, covariances, target.values, target.covariance, fit.T_camera_map, None, iterations=0)
    agrees = (fit.chi2[:, 0] < TUNING.link_chi2) & (fit.chi2[:, 1] < TUNING.link_chi2)
    least = TUNING.chain_least_pairs if is_gated else max(TUNING.chain_least_pairs, TUNING.agreeing_share * len(rows))
    if np.count_nonzero(agrees) < least:
        return f"only {np.count_nonzero(agrees)} of {len(rows)} features agree on a motion"
    fit = fit_pose(points, covariances, target.values, target.covariance, fit.T_camera_map, agrees)
    covariance = np.asarray(np.linalg.inv(fit.information), dtype=np.float64)
    sigma = np.sqrt(np.diag(covariance))
    if not (sigma[:3].max() < TUNING.unsure_m and sigma[3:].max() < TUNING.unsure_rad):
        return f"{np.count_nonzero(agrees)} features do not determine the motion"
    inliers = np.zeros(len(deep), dtype=np.bool_)
    inliers[rows[agrees]] = True
    of_source, of_target = np.zeros((len(deep), 6, 3)), np.zeros((len(deep), 6, 3))
    of_source[rows], of_target[rows] = gains_of(fit, covariance, points, covariances, source, target, agrees)
    return PairwisePose(se3.inverse(fit.T_camera_map), covariance, inliers, of_source, of_target)
