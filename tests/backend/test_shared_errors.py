"""The chain's covariance is joint: two links share the errors of the frame between them, with opposite signs."""

import numpy as np
import pytest
from made_up_scene import DEPTH_SIGMA, RAY_SIGMA, points_ahead
from made_up_scene import project as seen_from

from odom.backend.chain.pairwise import PairwisePose, register_frames
from odom.backend.chain.shared_errors import FrameErrors
from odom.evaluation.metrics import tangent_errors
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3

STEP = np.array([0.004, -0.002, 0.003, 0.002, -0.003, 0.001])
VARIANCES = np.array([RAY_SIGMA**2, 0.0, RAY_SIGMA**2, DEPTH_SIGMA**2])


def measured(rng, T_camera_world, points, blind):
    values = seen_from(T_camera_world, points) + rng.normal(size=(len(points), 3)) * np.sqrt(VARIANCES[[0, 2, 3]])
    values[rng.random(len(points)) < blind, 2] = np.nan
    variances = np.tile(VARIANCES, (len(points), 1))
    variances[np.isnan(values[:, 2]), 3] = np.nan
    return Measurements(values, np.zeros((len(points), 3, 3)), variances, np.zeros((len(points), 2)))


def chained(seed, frames, blind, change_every):
    """Errors (6) of a chain of `frames` links, with its covariance, joint and as if links were independent.

    Where `change_every` is not 0, all features are others from so many frames on: nothing is shared there.
    """
    rng = np.random.default_rng(seed)
    points = [points_ahead(rng, 90) for _ in range(frames + 1)]
    T_true, T, joint, independent = np.eye(4), np.eye(4), np.zeros((6, 6)), np.zeros((6, 6))
    errors, step = FrameErrors.nothing(), se3.exp(STEP)
    before, names = measured(rng, np.eye(4), points[0], blind), np.arange(90)
    for k in range(1, frames + 1):
        T_true = T_true @ step
        now = measured(rng, se3.inverse(T_true), points[0], blind)
        found = register_frames(before, now, step)
        assert isinstance(found, PairwisePose)
        covariance, turned = found.covariance, se3.adjoint(se3.inverse(found.T_previous_current))
        shared = turned @ errors.shared_with(names, found.of_previous)
        joint = se3.compose_covariance(joint, found.T_previous_current, covariance) + shared + shared.T
        independent = se3.compose_covariance(independent, found.T_previous_current, covariance)
        T, errors, before = T @ found.T_previous_current, FrameErrors.of(names, now, found.of_current), now
        if change_every and k % change_every == 0:
            points[0], names = se3.apply(T_true, points[k]), names + 1000
            before = measured(rng, se3.inverse(T_true), points[0], blind)
    return tangent_errors(T[None], T_true[None])[0], joint, independent


def nees(results, which):
    return np.mean([error @ np.linalg.solve(covariances[which], error) for error, *covariances in results])


@pytest.mark.parametrize("blind", [0.0, 0.3])
def test_a_chain_of_the_same_features_is_as_sure_as_it_says(blind):
    results = [chained(seed, 12, blind, change_every=0) for seed in range(60)]
    assert 4.5 < nees(results, 0) < 8.5  # 6, and a sixth more or less by chance; Cauchy weights add some
    assert nees(results, 1) < 2.5  # added up as if independent, the links are far less sure than they are


def test_links_without_a_common_feature_are_independent():
    error, joint, independent = chained(1, 6, 0.0, change_every=1)
    np.testing.assert_allclose(joint, independent, rtol=1e-12)
    assert error @ np.linalg.solve(joint, error) < 22.5  # the .999 quantile
