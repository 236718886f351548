"""The pose graph of key frames: registrations as edges, loop closures with robust weights (gtsam inside)."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from odom.geometry import se3
from odom.geometry.arrays import Array

_ROBUST_FROM_SIGMA = 3.0
"""Huber's bound on loop closures, in sigmas: beyond, the cost grows linearly."""
_SWAP = np.r_[3:6, 0:3]
"""Order of a tangent's entries in gtsam, which has the rotation first."""


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


def optimise(T_map_keyframe: dict[int, Array], held: Collection[int], edges: list[Edge]) -> dict[int, Array]:
    """Return the poses (4 x 4 by number) that agree best with all `edges`; those `held` stay where they are."""
    _, result = _solved(T_map_keyframe, held, edges)
    return {number: np.asarray(result.atPose3(number).matrix()) for number in T_map_keyframe}


def optimise_with_covariance(
    T_map_keyframe: dict[int, Array], held: int, edges: list[Edge], wanted: int
) -> tuple[dict[int, Array], Array]:
    """Return the poses as `optimise` does, and the 6 x 6 covariance (`se3`) of the `wanted` one against the held."""
    import gtsam

    graph, result = _solved(T_map_keyframe, [held], edges)
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
