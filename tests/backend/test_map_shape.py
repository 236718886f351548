"""How far key frames may be from where the map as a whole has them: against dense algebra, and against drawn errors."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.backend.map.pose_graph import Edge, EdgeArrays, optimise
from odom.backend.map.shape_covariance import shape_covariances
from odom.geometry import se3

SIGMA = np.repeat([2e-3, 1e-3], 3)


def drawn_poses(rng, count):
    return [se3.exp(np.concatenate([rng.uniform(-2.0, 2.0, 3), rng.normal(size=3)])) for _ in range(count)]


def covariance_of(rng):
    A = rng.normal(size=(6, 6)) * SIGMA[:, None]
    return A @ A.T + np.diag(SIGMA**2)


def walk_with_loops(rng, count, loops, first=0):
    """Edges from each pose to the next, and some from anywhere to anywhere."""
    pairs = {(k, k + 1) for k in range(count - 1)}
    pairs |= {tuple(sorted(rng.choice(count, 2, replace=False).tolist())) for _ in range(loops)}
    return [(first + a, first + b) for a, b in sorted(pairs)]


def exact(true, pairs, rng):
    return [Edge(a, b, se3.inverse(true[a]) @ true[b], covariance_of(rng)) for a, b in pairs]


def swing(T):
    """How poses T_map_camera of one part move with its middle, all below each other."""
    middle = np.eye(4)
    middle[:3, 3] = np.mean([one[:3, 3] for one in T], axis=0)
    return np.concatenate([se3.adjoint(se3.inverse(one) @ middle) for one in T])


def dense(T, edges):
    """The covariance of all poses of one part whose errors have no share in a motion of the whole."""
    n = 6 * len(T)
    H = np.zeros((n, n))
    for edge in edges:
        J = np.zeros((6, n))
        J[:, 6 * edge.a : 6 * edge.a + 6] = -se3.adjoint(se3.inverse(edge.T_a_b))
        J[:, 6 * edge.b : 6 * edge.b + 6] = np.eye(6)
        H += J.T @ np.linalg.inv(edge.covariance) @ J
    G = swing(T)
    whole = np.block([[H, G], [G.T, np.zeros((6, 6))]])
    scale = np.r_[np.full(n, 1e3), np.full(6, 1e-3)]  # as H is in 1/mm^2
    C = np.linalg.inv(whole / np.outer(scale, scale)) / np.outer(scale, scale)
    return [C[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(len(T))]


@given(st.integers(0, 10_000), st.integers(2, 20), st.integers(0, 8))
@settings(max_examples=20, deadline=None)
def test_covariances_are_those_of_dense_algebra(seed, count, loops):
    rng = np.random.default_rng(seed)
    true = drawn_poses(rng, count)
    edges = exact(true, walk_with_loops(rng, count, loops), rng)
    found = shape_covariances(np.array([se3.inverse(T) for T in true]), EdgeArrays.of(edges))
    for one, expected in zip(found, dense(true, edges), strict=True):
        np.testing.assert_allclose(one, expected, rtol=1e-4, atol=1e-9)


def test_each_part_has_coordinates_of_its_own_and_a_lone_pose_is_sure():
    rng = np.random.default_rng(1)
    true = drawn_poses(rng, 16)
    parts = [exact(true, walk_with_loops(rng, n, 2, first), rng) for n, first in ((6, 0), (9, 7))]
    T_camera_map = np.array([se3.inverse(T) for T in true])
    both = shape_covariances(T_camera_map, EdgeArrays.of([*parts[0], *parts[1]]))
    np.testing.assert_array_equal(both[6], np.zeros((6, 6)))
    for first, edges in zip((0, 7), parts, strict=True):
        n = 6 if first == 0 else 9
        own = [Edge(e.a - first, e.b - first, e.T_a_b, e.covariance) for e in edges]
        alone = shape_covariances(T_camera_map[first : first + n], EdgeArrays.of(own))
        np.testing.assert_allclose(both[first : first + n], alone, rtol=1e-6, atol=1e-12)
    assert (shape_covariances(T_camera_map[:2], EdgeArrays.of([])) == 0.0).all()


def test_drawn_maps_are_bent_as_their_covariances_say():
    rng = np.random.default_rng(2)
    true = drawn_poses(rng, 12)
    pairs = walk_with_loops(rng, 12, 4)
    nees = []
    for _ in range(200):
        noise = [covariance_of(rng) for _ in pairs]
        T_a_b = [
            se3.inverse(true[a]) @ true[b] @ se3.exp(np.linalg.cholesky(C) @ rng.normal(size=6))
            for (a, b), C in zip(pairs, noise, strict=True)
        ]
        edges = [Edge(a, b, T, C) for (a, b), T, C in zip(pairs, T_a_b, noise, strict=True)]
        start = np.array([se3.inverse(T) for T in true])
        found = optimise(start, np.arange(12) == 0, EdgeArrays.of(edges))
        error = np.array([se3.log(T @ now) for T, now in zip(found, map(se3.inverse, start), strict=True)])
        G = swing(true)
        error = (error.ravel() - G @ np.linalg.lstsq(G, error.ravel(), rcond=None)[0]).reshape(-1, 6)
        covariances = shape_covariances(found, EdgeArrays.of(edges))
        nees.append([e @ np.linalg.solve(C, e) for e, C in zip(error, covariances, strict=True)])
    assert 5.5 < np.mean(nees) < 6.5
