"""Properties that all estimators share."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from registration_clouds import noisy_pairs

from odom.errors import InputError
from odom.geometry.se3 import adjoint, apply, exp, inverse, log
from odom.registration import (
    Pairs,
    Prior,
    RecursiveFilter,
    Verdict,
    em_icp,
    horn,
    kalman,
    register,
    robust,
    wicp,
    with_scale,
)

ALL = {"horn": horn, "wicp": wicp, "em_icp": em_icp, "kalman": kalman, "robust": robust, "register": register}
every = pytest.mark.parametrize("estimator", ALL.values(), ids=ALL.keys())
filters = pytest.mark.parametrize("estimator", [kalman, robust, register])
tangents = arrays(np.float64, 6, elements=st.floats(-1.5, 1.5, allow_nan=False))


def exact(T, n=30, seed=0):
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 3))
    small = np.full((n, 3), 1e-8)
    return Pairs(q, apply(T, q), small, small)


@every
@given(xi=tangents)
def test_exact_pairs_give_the_motion_whatever_it_is(estimator, xi):
    result = estimator(exact(exp(xi)))
    assert result.verdict is Verdict.OK
    np.testing.assert_allclose(result.T_target_source, exp(xi), atol=1e-8)


@every
@given(xi=tangents)
def test_rotations_stay_rotations(estimator, xi):
    T = estimator(exact(exp(xi))).T_target_source
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) > 0.0


@every
def test_the_order_of_the_pairs_does_not_matter(estimator, rng):
    _, pairs = noisy_pairs(rng, 100, angle=0.2)
    order = rng.permutation(100)
    one, other = estimator(pairs), estimator(pairs[order])
    np.testing.assert_allclose(one.T_target_source, other.T_target_source, atol=1e-8)
    np.testing.assert_array_equal(one.inliers[order], other.inliers)


@every
def test_moving_the_target_moves_the_estimate(estimator, rng):
    _, pairs = noisy_pairs(rng, 100, angle=0.2)
    moved = exp(np.array([0.3, -0.2, 0.5, 0.4, 0.1, -0.3]))
    R = moved[:3, :3]
    other = Pairs(
        pairs.points_source,
        apply(moved, pairs.points_target),
        pairs.covariances_source,
        R @ pairs.covariances_target @ R.T,
    )
    np.testing.assert_allclose(
        estimator(other).T_target_source,
        moved @ estimator(pairs).T_target_source,
        atol=2e-4 if estimator is em_icp else 1e-6,
    )


@every
@pytest.mark.parametrize("sigmas", [1.0, 2.0])
def test_a_pair_of_weight_zero_does_not_count(estimator, sigmas, rng):
    _, pairs = noisy_pairs(rng, 60, angle=0.2)
    weights = np.ones(60)
    weights[::3] = 0.0
    C_source, C_target = pairs.covariances_source / sigmas**2, pairs.covariances_target / sigmas**2
    weighted = Pairs(pairs.points_source, pairs.points_target, C_source, C_target, weights)
    kept, alone = estimator(weighted), estimator(replace(weighted, weights=None)[weights > 0])
    np.testing.assert_allclose(kept.T_target_source, alone.T_target_source, atol=1e-3)
    np.testing.assert_allclose(kept.covariance, alone.covariance, atol=1e-2 * np.abs(alone.covariance).max())
    assert kept.variance_factor == pytest.approx(alone.variance_factor, rel=1e-2)
    assert not kept.inliers[::3].any()


def test_pairs_of_weight_zero_take_no_step_of_the_robust_filter(rng):
    _, pairs = noisy_pairs(rng, 60)
    weights = np.ones(60)
    weights[::3] = 0.0
    weighted = Pairs(
        pairs.points_source, pairs.points_target, pairs.covariances_source, pairs.covariances_target, weights
    )
    kept, alone = robust(weighted, theta=30.0), robust(pairs[weights > 0], theta=30.0)
    assert kept.details["halvings"] == alone.details["halvings"]
    np.testing.assert_allclose(kept.covariance, alone.covariance, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("setting", ["theta", "alpha"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -0.1])
@pytest.mark.parametrize("n", [2, 30])
def test_settings_that_make_no_robust_filter_are_refused(setting, value, n):
    with pytest.raises(InputError, match=setting):
        robust(exact(np.eye(4))[:n], **{setting: value})


def test_theta_changes_the_covariance_and_not_the_pose(rng):
    _, pairs = noisy_pairs(rng, 50)
    plain, discounted = robust(pairs, theta=0.0), robust(pairs, theta=30.0)
    assert plain.T_target_source.tobytes() == discounted.T_target_source.tobytes()
    assert np.linalg.eigvalsh(discounted.covariance - plain.covariance)[0] > 0.0


@filters
def test_covariance_is_in_the_source_frame_translation_first(estimator):
    """A rotation that cannot be seen well is a rotation about the source's axis along which the points lie."""
    rng = np.random.default_rng(3)
    n = 200
    q = rng.normal(size=(n, 3)) * [1.0, 0.03, 0.03]
    T = exp(np.array([0.1, 0.2, 0.3, 0.0, 0.0, np.pi / 2]))  # turns the source's x into the target's y
    C = np.full((n, 3), 1e-6)
    result = estimator(Pairs(q, apply(T, q) + rng.normal(0.0, 1e-3, (n, 3)), None, C))
    rotation = np.diag(result.covariance)[3:]
    assert rotation[0] > 20.0 * rotation[1:].max()


@filters
def test_a_prior_with_covariance_is_fused_as_evidence(estimator, rng):
    T, pairs = noisy_pairs(rng, 30, angle=0.2)
    alone = estimator(pairs)
    offset = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.01])
    P = np.diag([1e-6] * 6)
    fused = estimator(pairs, Prior(T @ exp(offset), P))
    information = np.linalg.inv(alone.covariance) + np.linalg.inv(P)
    expected = np.linalg.solve(information, np.linalg.solve(P, log(inverse(alone.T_target_source) @ T @ exp(offset))))
    np.testing.assert_allclose(log(inverse(alone.T_target_source) @ fused.T_target_source), expected, atol=2e-4)
    np.testing.assert_allclose(fused.covariance, np.linalg.inv(information), rtol=0.05, atol=1e-8)


@filters
def test_a_prior_without_covariance_is_only_where_to_begin(estimator, rng):
    T, pairs = noisy_pairs(rng, 100, angle=0.2)
    one = estimator(pairs)
    other = estimator(pairs, Prior(T @ exp(np.full(6, 0.02))))
    np.testing.assert_allclose(one.T_target_source, other.T_target_source, atol=1e-5)


def test_where_to_begin_does_not_matter_to_a_noisy_source_under_the_norm_bound(rng):
    """What allows for the source's noise needs the rotation, though the bound of S_k does not."""
    sigma, T = np.array([0.002, 0.002, 0.013]), exp(np.array([0.1, 0.0, 0.2, 0.0, np.pi / 6, 0.0]))
    q, C = rng.uniform(-0.2, 0.2, (5000, 3)), np.tile(np.diag(sigma**2), (5000, 1, 1))
    noise = sigma * rng.normal(size=(2, 5000, 3))
    pairs = Pairs(q + noise[0], apply(T, q) + noise[1], C, C)
    near, far = (robust(pairs, Prior(start), alpha=1.0, adaptive=False) for start in (T, np.eye(4)))
    off = log(inverse(near.T_target_source) @ far.T_target_source)
    assert off @ np.linalg.solve(near.covariance, off) < 0.01


def streamed(pairs):
    state = RecursiveFilter()
    for k in range(0, len(pairs), 500):
        state = state.absorb(pairs[k : k + 500])
    return state.estimate()


def heavy_tails(rng, noise):
    return noise / np.sqrt(rng.chisquare(4, (2, noise.shape[1], 1)) / 4.0)


CONTRADICTED = {
    "as stated": lambda _, noise: noise,
    "1.5 times as stated": lambda _, noise: 1.5 * noise,
    "4 mm more than stated": lambda rng, noise: noise + 0.004 * rng.normal(size=noise.shape),
    "heavy tails": heavy_tails,
}
"""The noise there is, of the noise stated."""


@pytest.mark.parametrize(
    ("estimator", "what"),
    [(estimator, "as stated") for estimator in (kalman, register, streamed)]
    + [(estimator, what) for estimator in (robust, partial(robust, alpha=1.0)) for what in CONTRADICTED],
)
def test_the_noise_of_the_source_does_not_turn_the_motion(estimator, what):
    """Noise that is larger along one axis, which the two clouds see along different ones, pulls at a rotation."""
    nees, sigma = [], np.array([0.002, 0.002, 0.013])
    T = exp(np.array([0.1, 0.0, 0.2, 0.0, np.pi / 6, 0.0]))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q, C = rng.uniform(-0.2, 0.2, (5000, 3)), np.tile(np.diag(sigma**2), (5000, 1, 1))
        noise = CONTRADICTED[what](rng, sigma * rng.normal(size=(2, 5000, 3)))
        result = estimator(Pairs(q + noise[0], apply(T, q) + noise[1], C, C))
        off = log(inverse(result.T_target_source) @ T)
        nees.append(off @ np.linalg.solve(result.covariance, off))
    assert np.mean(nees) == pytest.approx(6.0, abs=3.0)


@every
def test_scale_is_found_on_request(estimator, rng):
    T, pairs = noisy_pairs(rng, 200, angle=0.2)
    small = Pairs(pairs.points_source / 1.25, pairs.points_target, pairs.covariances_source, pairs.covariances_target)
    result = with_scale(estimator)(small)
    assert result.scale == pytest.approx(1.25, rel=5e-3)
    np.testing.assert_allclose(result.T_target_source, T, atol=0.02)


@pytest.mark.parametrize("estimator", [kalman, register, wicp, horn])
@pytest.mark.parametrize("distance_m", [0.0, 3.0])
def test_the_covariance_of_a_motion_found_with_its_scale_is_true(estimator, distance_m):
    nees, sigma = [], 0.005
    for seed in range(60):
        rng = np.random.default_rng(seed)
        q, T = rng.uniform(-0.5, 0.5, (100, 3)), exp(rng.normal(0.0, 0.3, 6))
        q[:, 2] += distance_m
        p, known = apply(T, 1.3 * q), None if estimator is horn else np.full((100, 3), sigma**2)
        noisy = Pairs(q + rng.normal(0.0, sigma, q.shape), p + rng.normal(0.0, sigma, q.shape), known, known)
        result = with_scale(estimator)(noisy)
        off = log(inverse(result.T_target_source) @ T)
        nees.append(off @ np.linalg.solve(result.covariance, off))
    assert np.mean(nees) == pytest.approx(6.0, abs=1.5)


@pytest.mark.parametrize("estimator", [kalman, register, wicp])
def test_the_scale_of_a_noisy_source_is_not_too_small(estimator):
    scales = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        q, sigma = rng.uniform(-0.2, 0.2, (400, 3)), 0.02
        noise, C = rng.normal(0.0, sigma, (2, 400, 3)), np.full((400, 3), sigma**2)
        result = with_scale(estimator)(Pairs(q + noise[0], 1.3 * q + noise[1], C, C))
        scales.append(result.scale / 1.3)
    assert np.mean(scales) == pytest.approx(1.0, abs=3.0 * np.std(scales) / np.sqrt(60))


@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_a_flat_target_is_registered_by_em_icp(noise_m):
    rng = np.random.default_rng(0)
    q = np.column_stack([rng.uniform(-1.0, 1.0, (400, 2)), np.full(400, 2.1)])
    T = exp(np.array([0.1, 0.02, 0.0, 0.0, 0.0, 0.2]))
    p = apply(T, q) + np.column_stack([rng.normal(0.0, noise_m, (400, 2)), np.zeros(400)])
    result = em_icp(Pairs(q, p, None, np.full((400, 3), 0.01**2)))
    assert result.ok
    np.testing.assert_allclose(result.T_target_source, T, atol=2e-3)


@pytest.mark.parametrize("estimator", [wicp, em_icp])
def test_correspondences_are_found_when_none_are_given(estimator):
    rng = np.random.default_rng(0)
    n = 400
    q = rng.uniform(-1.0, 1.0, (n, 3))
    T = exp(np.array([0.02, -0.01, 0.015, 0.01, -0.02, 0.01]))
    order = rng.permutation(n)
    C = np.full((n, 3), 1e-6)
    noisy = apply(T, q)[order] + rng.normal(0.0, 1e-3, (n, 3))
    result = estimator(Pairs(q, noisy, C, C), matched=False)
    assert result.ok
    np.testing.assert_allclose(result.T_target_source, T, atol=1e-3)


# bad input: an error of the family or the degenerate verdict, never a silent pose


@every
@pytest.mark.parametrize("n", [0, 1, 2])
def test_fewer_than_three_pairs_are_degenerate(estimator, n):
    result = estimator(exact(np.eye(4))[:n])
    assert result.verdict is Verdict.DEGENERATE
    assert "3" in result.reason
    assert np.isnan(result.T_target_source).all()


def test_three_pairs_are_too_few_for_the_gate_and_enough_for_the_filters_without_it():
    three = exact(np.eye(4))[:3]
    assert not register(three).ok
    assert kalman(three).ok


@every
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_points_on_a_line_are_degenerate(estimator, noise, rng):
    n = 60
    line = np.outer(rng.uniform(-1.0, 1.0, n), [1.0, 2.0, 0.5]) + np.array([0.0, 0.0, 2.0])
    C = np.full((n, 3), max(noise, 1e-4) ** 2)
    result = estimator(Pairs(line + rng.normal(0, noise, (n, 3)), line + rng.normal(0, noise, (n, 3)), C, C))
    assert result.verdict is Verdict.DEGENERATE, result
    assert result.reason


@every
def test_coinciding_points_are_degenerate(estimator):
    points = np.ones((20, 3))
    C = np.full((20, 3), 1e-6)
    assert estimator(Pairs(points, points, C, C)).verdict is Verdict.DEGENERATE


@every
def test_points_in_a_plane_are_enough(estimator, rng):
    T, pairs = noisy_pairs(rng, 200, angle=0.2)
    q = pairs.points_source.copy()
    q[:, 2] = 1.0
    C = np.full((200, 3), 1e-6)
    result = estimator(Pairs(q, apply(T, q) + rng.normal(0, 1e-3, (200, 3)), C, C))
    assert result.ok, result.reason
    np.testing.assert_allclose(result.T_target_source, T, atol=2e-3)


@every
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("side", ["points_source", "points_target"])
def test_points_that_are_not_finite_are_an_error(estimator, side, value):
    pairs = exact(np.eye(4))
    getattr(pairs, side)[3, 1] = value
    with pytest.raises(InputError, match="finite"):
        estimator(pairs)


@every
@pytest.mark.parametrize("weight", [np.nan, np.inf, -1.0])
def test_weights_that_are_not_positive_are_an_error(estimator, weight):
    pairs = exact(np.eye(4))
    weights = np.ones(len(pairs))
    weights[5] = weight
    with pytest.raises(InputError, match="weights"):
        estimator(
            Pairs(pairs.points_source, pairs.points_target, pairs.covariances_source, pairs.covariances_target, weights)
        )


@filters
@pytest.mark.parametrize(("source", "target"), [(5e6, 5e6), (5e6, 0.0), (0.0, -5e6)])
def test_coordinates_that_cost_the_digits_of_the_noise_are_an_error(estimator, source, target, rng):
    q, C = rng.uniform(-1.0, 1.0, (100, 3)), np.full((100, 3), 1e-4)
    with pytest.raises(InputError, match="km from the origin"):
        estimator(Pairs(q + source, q + target, C, C))


@filters
def test_the_covariance_is_true_ninety_kilometres_from_the_origin(estimator):
    nees, offset = [], np.array([9e4, -9e4, 0.0])
    for seed in range(60):
        rng = np.random.default_rng(seed)
        q, C = rng.uniform(-1.0, 1.0, (100, 3)), np.full((100, 3), 1e-6)
        noise = rng.normal(0.0, 1e-3, (2, 100, 3))
        result = estimator(Pairs(q + noise[0] + offset, q + noise[1] + offset, C, C))
        here = exp(np.concatenate([offset, np.zeros(3)]))  # the motion of the middle of the points
        xi, A = log(inverse(here) @ inverse(result.T_target_source) @ here), adjoint(inverse(here))
        nees.append(xi @ np.linalg.solve(A @ result.covariance @ A.T, xi))
    assert 4.5 < np.mean(nees) < 7.5


def test_one_pair_that_is_far_away_is_left_out_by_the_gate(rng):
    _, pairs = noisy_pairs(rng, 50)
    pairs.points_target[7] = 1e7
    result = register(pairs)
    assert result.ok
    assert not result.inliers[7]


@filters
@pytest.mark.parametrize("bad", [np.zeros((3, 3)), -np.eye(3), np.full((3, 3), np.nan), np.diag([1e-4, 1e-4, 0.0])])
def test_a_covariance_that_is_not_positive_is_an_error(estimator, bad):
    pairs = exact(np.eye(4))
    C = pairs.covariances_target.copy()
    C[4] = bad
    with pytest.raises(InputError, match="pair 4"):
        estimator(Pairs(pairs.points_source, pairs.points_target, None, C))


@filters
def test_missing_covariances_are_an_error(estimator):
    pairs = exact(np.eye(4))
    with pytest.raises(InputError, match="covariances"):
        estimator(Pairs(pairs.points_source, pairs.points_target))


@pytest.mark.parametrize(
    "arguments",
    [
        (np.zeros((4, 2)), np.zeros((4, 2))),
        (np.zeros((4, 3)), np.zeros((5, 3))),
        (np.zeros(3), np.zeros(3)),
        (np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 2))),
        (np.zeros((4, 3)), np.zeros((4, 3)), None, np.zeros((3, 3, 3))),
        (np.zeros((4, 3)), np.zeros((4, 3)), None, None, np.zeros(3)),
    ],
)
def test_wrong_shapes_are_an_error(arguments):
    with pytest.raises(InputError, match="shape"):
        Pairs(*arguments)


@pytest.mark.parametrize(
    "arguments",
    [(np.zeros((4, 4)),), (np.full((4, 4), np.nan),), (np.eye(4), np.zeros((6, 6))), (np.eye(4), np.eye(3))],
)
def test_a_prior_that_is_no_motion_is_an_error(arguments):
    with pytest.raises(InputError, match="prior"):
        Prior(*arguments)


MOVED = exp(np.array([0.1, -0.2, 0.3, 0.2, 0.1, -0.3]))


def test_a_transposed_prior_is_told():
    with pytest.raises(InputError, match="transposed"):
        Prior(MOVED.T)


@pytest.mark.parametrize(
    "T",
    [np.diag([1.0, 1.0, -1.0, 1.0]), -np.eye(4), np.diag([1.0, 1.0, 1.0, 2.0]), MOVED + 0.1 * np.eye(4)[[3, 2, 1, 0]]],
    ids=["mirrored", "inverted", "scaled", "skewed"],
)
def test_a_prior_that_mirrors_or_has_another_last_row_is_an_error(T):
    with pytest.raises(InputError, match="last row 0 0 0 1"):
        Prior(T)


def test_a_prior_that_is_off_by_rounding_is_taken():
    T, P = np.linalg.inv(np.linalg.inv(MOVED)), np.diag([1e-4] * 6)
    T[3, 0], P[0, 5] = 1e-12, 1e-12
    assert Prior(T, P).covariance is not None


def test_a_covariance_of_the_prior_that_is_not_symmetric_is_an_error():
    P = 1e-4 * np.eye(6)
    P[0, 5] = 5e-5
    with pytest.raises(InputError, match="symmetric"):
        Prior(np.eye(4), P)


def test_inputs_are_left_as_they_were(rng):
    _, pairs = noisy_pairs(rng, 50)
    before = [a.copy() for a in (pairs.points_source, pairs.points_target, pairs.covariances_source)]
    prior = Prior(np.eye(4), np.eye(6))
    for estimator in ALL.values():
        estimator(pairs, prior)
    for a, b in zip(before, (pairs.points_source, pairs.points_target, pairs.covariances_source), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(prior.T_target_source, np.eye(4))


def test_results_repeat_to_the_byte(rng):
    _, pairs = noisy_pairs(rng, 200)
    for estimator in ALL.values():
        one, two = estimator(pairs), estimator(pairs)
        assert one.T_target_source.tobytes() == two.T_target_source.tobytes()
        assert one.covariance.tobytes() == two.covariance.tobytes()


def distorted(seed, D):
    """Pairs whose target is distorted by `D` (3 x 3), which no covariance tells of."""
    T, pairs = noisy_pairs(np.random.default_rng(seed), 200, angle=0.2)
    return T, replace(pairs, points_target=pairs.points_target @ D.T)


def test_an_axis_that_reads_wrong_is_set_right_and_a_distortion_in_all_directions_is_not_taken_for_one():
    """Neighbouring pixels share a shutter, a lens and late depth: that distorts a cloud in all six directions."""
    axis, mixed = [], []
    for seed in range(40):
        rng = np.random.default_rng(1000 + seed)
        D = rng.normal(0.0, 0.004, (3, 3))
        for found, given_D in ((axis, np.diag([1.0, 1.0, 1.02])), (mixed, np.eye(3) + 0.5 * (D + D.T))):
            T, pairs = distorted(seed, given_D)
            result, plain = robust(pairs), robust(pairs, adaptive=False)
            error, before = (np.linalg.norm(log(inverse(T) @ one.T_target_source)) for one in (result, plain))
            found.append((result.details["axis_scale"] != 1.0, error < before))
    assert np.mean(axis, axis=0).min() > 0.9
    assert np.mean(mixed, axis=0)[0] < 0.1
