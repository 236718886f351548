"""The pose that most of an image agrees with, where its features follow several motions: the scene's and passers-by's.

Random triples of features each give a pose, which the others then refine (M. Fischler, R. Bolles, CACM 24, 1981;
O. Chum et al., DAGM 2003). Features vote for the poses they agree with (see `VotingFeatures`). Poses that would be a
jerk count less than others.
"""

import math

import numpy as np

from odom.backend.tracking.expected_pose import ExpectedPose
from odom.backend.tracking.pose_solver import projected
from odom.backend.tracking.tuning import TUNING
from odom.backend.tracking.voting_features import VotingFeatures
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.geometry import se3
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import is_shorter, moved, solve_definite

_TRIPLE_STEPS, _WIDE_STEPS, _NARROW_STEPS = 4, 2, 1
"""Gauss-Newton steps from a triple alone, and then from all features, less and less tolerant."""
_WIDE = 2.0
"""How much more tolerant the first steps from all features are."""
_WORTH_REFINING = 0.6
"""A triple's pose with this share of the most votes so far is refined."""
_PRIOR = 1e-6
"""Information that keeps a triple in one line from running away."""
_LARGEST_STEP = 1.0
"""With a step (m, rad) beyond this, a fit counts as diverged."""
_MISSED, _CLEAN = 1e-3, 0.5
"""Allowed probability to miss a pose that would win, and the share of its own features' triples that lead to it."""


def consensus(features: VotingFeatures, T_camera_map: Array, expected: ExpectedPose) -> Array | None:
    """Return a pose that clearly more of the features agree with than with `T_camera_map`; None if there is none."""
    off_px_before = features.off_px(T_camera_map)
    if np.count_nonzero(off_px_before > TUNING.agrees_px) < TUNING.contested_least:
        return None
    votes = features.votes
    voting = np.ascontiguousarray(features.points), np.ascontiguousarray(features.rays), votes
    sigma, T_start = features.sigma_px * features.pixel, np.ascontiguousarray(T_camera_map)
    reach = se3.inverse(expected.T_camera_map), expected.free
    first = _agreement(voting, sigma, T_start, reach)
    tried = triples_needed(TUNING.consensus_gain * first / float(votes.sum()))
    triples = np.random.default_rng(0).choice(len(votes), (tried, 3), p=votes / votes.sum())
    T, gain = _best_pose(voting, sigma, T_start, first, triples, reach)
    differs_px = TUNING.agrees_px if gain > TUNING.consensus_clear else TUNING.differs_px
    won = np.count_nonzero((features.off_px(T) < TUNING.agrees_px) & (off_px_before > differs_px))
    return se3.orthonormal(T) if gain > TUNING.consensus_gain and won >= TUNING.contested_least else None


def triples_needed(share: float) -> int:
    """Return how many triples must be tried to find a pose that has at least a `share` of all votes (at most 1).

    Source: Fischler and Bolles' count; for a small share it is the largest number that is ever tried.
    """
    pure = _CLEAN * min(share, 1.0) ** 3
    if pure < 1.0 - _MISSED ** (1.0 / TUNING.triples):
        return TUNING.triples
    return math.ceil(math.log(_MISSED) / math.log(1.0 - pure))


def warm_up() -> None:
    """Compile what `consensus` needs, or load it: in a still scene it is not called before the first passer-by."""
    points = np.random.default_rng(0).uniform((-1.0, -1.0, 2.0), (1.0, 1.0, 4.0), (40, 3))
    rays = points[:, :2] / points[:, 2:]
    features = VotingFeatures(points, np.zeros(3), rays, points[:, :2], np.ones(40, np.int64), 1.0, 1e-3)
    T_wrong = se3.exp(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
    consensus(features, T_wrong, ExpectedPose.at_unknown_velocity(np.eye(4), 1.0))


@compiled
def _agreement(voting: tuple[Array, Array, Array], sigma: float, T: Array, reach: tuple[Array, Array]) -> float:
    """Return the votes for the pose `T` of features: `voting` are their points, rays and votes, `sigma` the rays'.

    `reach` is T_map_expected, and how far a pose may be from the one expected (m, rad): one farther away has fewer
    votes. Angles count by their sine.
    """
    points, rays, votes = voting
    T_map_expected, free = reach
    total = 0.0
    for k in range(points.shape[0]):
        x, y, w = projected(T, points, k)
        if w > 0.0:
            x, y = rays[k, 0] - x, rays[k, 1] - y
            total += votes[k] / (1.0 + (x * x + y * y) / sigma**2)
    D = np.zeros((3, 4))
    for i in range(3):
        for j in range(4):
            for k in range(4):
                D[i, j] += T[i, k] * T_map_expected[k, j]
    away_m2 = D[0, 3] ** 2 + D[1, 3] ** 2 + D[2, 3] ** 2
    away_rad2 = 0.25 * ((D[2, 1] - D[1, 2]) ** 2 + (D[0, 2] - D[2, 0]) ** 2 + (D[1, 0] - D[0, 1]) ** 2)
    surprise = away_m2 / free[0] ** 2 + away_rad2 / free[1] ** 2
    return float(total / max(1.0, surprise))


@compiled
def _refined(
    voting: tuple[Array, Array, Array], sigma: float, T_start: Array, members: Index, steps: int
) -> tuple[Array, bool]:
    """Return the pose fitted to the features `members`, robustly unless `sigma` is infinite; False if it diverges."""
    points, rays, votes = voting
    T = T_start
    J = np.zeros((3, 6))
    for _ in range(steps):
        H = _PRIOR * np.eye(6)
        g = np.zeros(6)
        for k in members:
            x, y, w = projected(T, points, k)
            if w == 0.0:
                continue
            rx, ry = rays[k, 0] - x, rays[k, 1] - y
            weight = votes[k] / (1.0 + (rx * rx + ry * ry) / sigma**2) ** 2
            interaction_matrix(x, y, w, J)
            for a in range(6):
                g[a] += weight * (J[0, a] * rx + J[1, a] * ry)
                for b in range(a + 1):
                    H[a, b] += weight * (J[0, a] * J[0, b] + J[1, a] * J[1, b])
        step = solve_definite(H, g)
        if not is_shorter(step, _LARGEST_STEP):
            return T, False
        T = moved(step, T)
    return T, True


@compiled
def _best_pose(
    voting: tuple[Array, Array, Array],
    sigma: float,
    T_start: Array,
    first: float,
    triples: Index,
    reach: tuple[Array, Array],
) -> tuple[Array, float]:
    """Return the pose with the most votes that a triple leads to, and how many times as many as `T_start`'s `first`."""
    best, most = T_start, first
    everything = np.arange(len(voting[0]))
    for s in range(triples.shape[0]):
        T, good = _refined(voting, np.inf, T_start, triples[s], _TRIPLE_STEPS)
        if not good:
            continue
        if _agreement(voting, sigma, T, reach) < _WORTH_REFINING * most:
            continue
        T, good = _refined(voting, _WIDE * sigma, T, everything, _WIDE_STEPS)
        if not good:
            continue
        T, good = _refined(voting, sigma, T, everything, _NARROW_STEPS)
        agreed = _agreement(voting, sigma, T, reach)
        if good and agreed > most:
            best, most = T, agreed
    return best, most / first if first > 0.0 else np.inf
