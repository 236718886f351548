"""How sure the numbers of a fit are, where neighbouring errors hang together."""

import numpy as np

from odom.backend.mapping.schur_complement import reduce_to_poses, substitute_landmarks
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.calibration.adjustment import Fit, Prior
from odom.calibration.linearised import Linearised, chi_squared, linearised
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.evaluation.sandwich import sandwich_sigma
from odom.geometry.arrays import Array

_DAMPING = 1e-10
"""Of the landmarks' blocks, as at the end of an adjustment."""


def sigmas(survey: Survey, fitted: Fit, prior: Prior) -> Array:
    """Return the standard deviations (p) of the fit's free numbers.

    Each is the larger of two sandwich estimates, whose blocks are stretches of time and neighbouring landmarks: a
    depth image errs alike for a second, and a landmark that was chosen badly errs in every frame.
    """
    lines = linearised(survey, fitted.vector, fitted.bundle)
    scores, information = _scores(survey, lines, fitted)
    information = information + np.diag(prior.sigma[fitted.free] ** -2.0)
    by_time = np.argsort(survey.seconds[survey.frame], kind="stable")
    return np.maximum(
        sandwich_sigma(information, scores[by_time], TUNING.sure_blocks),
        sandwich_sigma(information, scores, TUNING.sure_blocks),
    )


def _scores(survey: Survey, lines: Linearised, fitted: Fit) -> tuple[Array, Array]:
    """Return each observation's pull at the free numbers (N x p), and their information (p x p).

    Poses and landmarks follow every number as the normal equations say.
    """
    free, bundle = fitted.free, fitted.bundle
    o = lines.observations(survey, free, np.zeros(len(free)))
    number = np.full(len(survey.is_fixed), -1, dtype=np.int64)
    number[~survey.is_fixed] = np.arange(np.count_nonzero(~survey.is_fixed))
    poses = 6 * int(np.count_nonzero(~survey.is_fixed))
    S, _, V_inverse, b, W_number, W, _ = reduce_to_poses(
        bundle.T_camera_map, bundle.landmarks, np.zeros(len(free)), number, poses + len(free), o.keyframe, o.landmark,
        o.values, o.jacobian_timing, o.variances, _DAMPING, TRACKING.cauchy_chi2,
    )  # fmt: skip
    S.flat[: poses * len(S) : len(S) + 1] += 1e-9
    follows = -np.linalg.solve(S[:poses, :poses], S[:poses, poses:])
    J, P = _derivatives(survey, lines, fitted)
    moved = np.zeros((len(survey.is_fixed), 6))
    still = np.zeros_like(bundle.landmarks)
    by_number = np.empty_like(o.jacobian_timing)
    for k in range(len(free)):
        step = np.concatenate([follows[:, k], np.eye(len(free))[k]])
        points = substitute_landmarks(
            still, number, o.keyframe, o.landmark, V_inverse, np.zeros_like(b), W_number, W, step
        )
        moved[~survey.is_fixed] = follows[:, k].reshape(-1, 6)
        by_number[:, :, k] = (
            o.jacobian_timing[:, :, k]
            - np.einsum("nij,nj->ni", J, moved[survey.frame])
            - np.einsum("nij,nj->ni", P, points[survey.landmark])
        )
    weighted, residuals = _weighted(lines), np.nan_to_num(lines.residuals)
    whitened = np.einsum("nij,njk->nik", weighted, by_number)
    information = np.einsum("nik,nil->kl", by_number, whitened)
    return np.einsum("nik,ni->nk", whitened, residuals), information


def _weighted(lines: Linearised) -> Array:
    """Return the robust information (N x 3 x 3) of each observation, 0 for depth that was not measured."""
    ray, depth = chi_squared(lines)
    xx, across, yy, ww = lines.variances.T
    weight = 1.0 / (1.0 + ray / TRACKING.cauchy_chi2) / (xx * yy - across * across)
    out = np.zeros((len(ray), 3, 3))
    out[:, 0, 0], out[:, 1, 1] = yy * weight, xx * weight
    out[:, 0, 1] = out[:, 1, 0] = -across * weight
    has_depth = lines.values[:, 2] > 0.0
    out[has_depth, 2, 2] = (1.0 / (1.0 + depth / TRACKING.cauchy_chi2) / ww)[has_depth]
    return out


def _derivatives(survey: Survey, lines: Linearised, fitted: Fit) -> tuple[Array, Array]:
    """Return the derivatives of x/z, y/z, 1/z by the pose (N x 3 x 6, moved on the left) and landmark (N x 3 x 3)."""
    x, y, w = lines.predicted.T
    by_point = np.zeros((len(x), 3, 3))
    by_point[:, 0, 0] = by_point[:, 1, 1] = w
    by_point[:, 0, 2], by_point[:, 1, 2], by_point[:, 2, 2] = -x * w, -y * w, -w * w
    turned = np.cross(lines.in_camera[:, None], np.eye(3))
    J = np.concatenate([by_point, by_point @ turned], axis=2)
    return J, by_point @ fitted.bundle.T_camera_map[survey.frame][:, :3, :3]
