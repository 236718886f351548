"""The pose graph of key frames: registrations as edges, loop closures with robust weights.

What works beside frames is compiled and leaves the interpreter to them; gtsam, which holds it, is asked at the end.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from odom.backend.map.block_cholesky import BlockPattern, factorise, solve
from odom.backend.map.graph_terms import accumulate, moved_by
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask

_ROBUST_FROM_SIGMA = 3.0
"""Huber's bound on loop closures, in sigmas: beyond, the cost grows linearly."""
_SWAP = np.r_[3:6, 0:3]
"""Order of a tangent's entries in gtsam, which has the rotation first."""
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e-9, 1e6
"""Levenberg-Marquardt's, as a share of the diagonal: a graph with one closure is nearly linear. Where even the most
gains nothing, the poses stay."""
_CONVERGED = 1e-5
"""Share of the cost that a step must gain for another one to follow: less moves no pose by a tenth of its sigma."""
_MOST_STEPS = 20
"""Bound on the steps; closures of a walk take 3 to 6."""
_LEAST_VARIANCE = 1e-12
"""m^2, rad^2; added to variances, so that a registration that claims to be exact can be weighed."""


@dataclass(frozen=True, eq=False)
class Edge:
    """A registration of key frames `a` and `b`: T_a_b and its 6 x 6 covariance (`se3`, frame b)."""

    a: int
    b: int
    T_a_b: Array
    covariance: Array
    is_loop: bool = False

    @cached_property
    def variance(self) -> float:
        """The trace of the covariance; metres and radians count alike, as they do for a feature at a metre."""
        return float(np.trace(self.covariance))

    def seen_from(self, number: int) -> "Edge":
        """Return the same registration with key frame `number`, one of the two, as `a`."""
        if number == self.a:
            return self
        covariance = se3.inverse_covariance(self.T_a_b, self.covariance)
        return Edge(self.b, self.a, se3.inverse(self.T_a_b), covariance, self.is_loop)

    def then(self, onward: "Edge") -> "Edge":
        """Return the registration of `a` and `onward.b` by way of `b`, where `onward` begins."""
        covariance = se3.compose_covariance(self.covariance, onward.T_a_b, onward.covariance)
        return Edge(self.a, onward.b, self.T_a_b @ onward.T_a_b, covariance, self.is_loop or onward.is_loop)


@dataclass(frozen=True, eq=False)
class EdgeArrays:
    """m registrations: key frames `a` and `b` (m), `T_a_b` (m x 4 x 4), `covariance` (m x 6 x 6), `is_loop` (m)."""

    a: Index
    b: Index
    T_a_b: Array
    covariance: Array
    is_loop: Mask

    @classmethod
    def of(cls, edges: Sequence[Edge]) -> "EdgeArrays":
        """Return the registrations as arrays."""
        return cls(
            np.array([e.a for e in edges], dtype=np.int64),
            np.array([e.b for e in edges], dtype=np.int64),
            np.array([e.T_a_b for e in edges]).reshape(-1, 4, 4),
            np.array([e.covariance for e in edges]).reshape(-1, 6, 6),
            np.array([e.is_loop for e in edges], dtype=np.bool_),
        )

    def take(self, chosen: Index | Mask) -> "EdgeArrays":
        """Return the chosen ones."""
        return EdgeArrays(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def joined(self, more: "EdgeArrays") -> "EdgeArrays":
        """Return these and `more`."""
        names = self.__dataclass_fields__
        return EdgeArrays(*(np.concatenate([getattr(self, name), getattr(more, name)]) for name in names))


def optimise(T_camera_map: Array, is_held: Mask, edges: EdgeArrays) -> Array:
    """Return the poses (K x 4 x 4) that agree best with all `edges`, whose ends are their rows.

    Those that are held stay where they are; something must be held of each part that edges connect. Levenberg-Marquardt
    with Huber's weights on loops.
    """
    place = np.full(len(T_camera_map), -1, dtype=np.int64)
    free = np.flatnonzero(~is_held)
    if not len(free) or not len(edges.a):
        return T_camera_map
    place[free] = np.arange(len(free))
    edges = edges.take(np.flatnonzero((place[edges.a] >= 0) | (place[edges.b] >= 0)))
    is_inner = np.flatnonzero((place[edges.a] >= 0) & (place[edges.b] >= 0))
    pattern = BlockPattern.of(len(free), place[edges.a[is_inner]], place[edges.b[is_inner]])
    place[free] = pattern.place
    slot, is_turned = np.zeros(len(edges.a), dtype=np.int64), np.zeros(len(edges.a), dtype=np.bool_)
    slot[is_inner], is_turned[is_inner] = pattern.slot, pattern.is_turned
    information = np.linalg.inv(edges.covariance + _LEAST_VARIANCE * np.eye(6))
    L, g = np.zeros((len(pattern.row), 6, 6)), np.zeros((len(free), 6))

    measured = edges.a, edges.b, edges.T_a_b, np.asarray(information), edges.is_loop

    def equations(T: Array) -> float:
        return accumulate(T, *measured, _ROBUST_FROM_SIGMA, place, pattern.start, slot, is_turned, L, g)

    best, damping = T_camera_map, _FIRST_DAMPING
    cost = equations(best)
    for _ in range(_MOST_STEPS):
        L[pattern.start[:-1]] += damping * (L[pattern.start[:-1]] * np.eye(6))
        is_definite = factorise(pattern.start, pattern.row, L)
        if is_definite:
            solve(pattern.start, pattern.row, L, g)
        trial = moved_by(best, place, g)
        lower = equations(trial) if is_definite else np.inf
        if lower < cost:
            gained, best, cost = cost - lower, trial, lower
            damping = max(0.1 * damping, _LEAST_DAMPING)
            if gained <= _CONVERGED * cost:
                break
        elif damping > _MOST_DAMPING or cost - lower > -1e-9 * cost:
            break
        else:
            damping *= 100.0
            equations(best)
    return best


def optimise_with_covariance(
    T_map_keyframe: dict[int, Array], held: Collection[int], edges: list[Edge], wanted: int
) -> tuple[dict[int, Array], Array]:
    """Return T_map_keyframe as `optimise` does, and the 6 x 6 covariance (`se3`) of the `wanted` one against the held.

    Raises RuntimeError where the edges do not determine the poses.
    """
    import gtsam

    graph, result = _solved(T_map_keyframe, held, edges)
    covariance = gtsam.Marginals(graph, result).marginalCovariance(wanted)[np.ix_(_SWAP, _SWAP)]
    return {number: np.asarray(result.atPose3(number).matrix()) for number in T_map_keyframe}, np.asarray(covariance)


def _solved(T_map_keyframe: dict[int, Array], held: Collection[int], edges: list[Edge]) -> tuple[Any, Any]:
    """Return gtsam's graph and the values that solve it."""
    import gtsam

    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for number, T in T_map_keyframe.items():
        start.insert(number, gtsam.Pose3(T))
    for number in held:
        still = gtsam.noiseModel.Isotropic.Sigma(6, 1e-6)
        graph.add(gtsam.PriorFactorPose3(number, gtsam.Pose3(T_map_keyframe[number]), still))
    for edge in edges:
        noise: gtsam.noiseModel.Base = gtsam.noiseModel.Gaussian.Covariance(
            edge.covariance[np.ix_(_SWAP, _SWAP)] + 1e-12 * np.eye(6)
        )
        if edge.is_loop:
            robust = gtsam.noiseModel.mEstimator.Huber.Create(_ROBUST_FROM_SIGMA)
            noise = gtsam.noiseModel.Robust.Create(robust, noise)
        graph.add(gtsam.BetweenFactorPose3(edge.a, edge.b, gtsam.Pose3(edge.T_a_b), noise))
    return graph, gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
