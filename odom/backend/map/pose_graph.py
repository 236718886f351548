"""The pose graph of key frames: registrations as edges, loop closures with robust weights.

What runs in the background is compiled and releases the GIL, so that frames need not wait.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from odom.backend.map.block_cholesky import BlockPattern, factorise, solve
from odom.backend.map.graph_terms import accumulate, moved_by
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask

_ROBUST_FROM_SIGMA = 3.0
"""Huber's bound on loop closures, in sigmas: beyond, the cost grows linearly."""
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


class Equations:
    """The normal equations of a pose graph: of poses (K), of which some are held, and the `edges` between their rows.

    `L` is the lower triangle, or its factor, by `pattern`, and `g` (n x 6) the right side; `place` (K) is a pose's row
    in both, negative where it is held.
    """

    def __init__(self, is_held: Mask, edges: EdgeArrays) -> None:
        free = np.flatnonzero(~is_held)
        place = np.full(len(is_held), -1, dtype=np.int64)
        place[free] = np.arange(len(free))
        edges = edges.take(np.flatnonzero((place[edges.a] >= 0) | (place[edges.b] >= 0)))
        is_inner = np.flatnonzero((place[edges.a] >= 0) & (place[edges.b] >= 0))
        self.pattern = BlockPattern.of(len(free), place[edges.a[is_inner]], place[edges.b[is_inner]])
        place[free] = self.pattern.place
        self.place = place
        slot, is_turned = np.zeros(len(edges.a), dtype=np.int64), np.zeros(len(edges.a), dtype=np.bool_)
        slot[is_inner], is_turned[is_inner] = self.pattern.slot, self.pattern.is_turned
        information = np.asarray(np.linalg.inv(edges.covariance + _LEAST_VARIANCE * np.eye(6)))
        self.L, self.g = np.zeros((len(self.pattern.row), 6, 6)), np.zeros((len(free), 6))
        self._measured = edges.a, edges.b, edges.T_a_b, information, edges.is_loop
        self._slots = slot, is_turned

    def set_up(self, T_camera_map: Array) -> float:
        """Set both sides to those at the poses (K x 4 x 4); return the cost there."""
        at = self.place, self.pattern.start, self._slots
        return accumulate(T_camera_map, self._measured, _ROBUST_FROM_SIGMA, *at, self.L, self.g)

    def damp(self, share: float) -> None:
        """Add a `share` of the diagonal to it."""
        self.L[self.pattern.start[:-1]] += share * (self.L[self.pattern.start[:-1]] * np.eye(6))

    def factorise(self) -> bool:
        """Replace the left side by its Cholesky factor; return False where it has none."""
        return factorise(self.pattern.start, self.pattern.row, self.L)

    def solve(self) -> None:
        """Replace the right side by the solution, once factorised."""
        solve(self.pattern.start, self.pattern.row, self.L, self.g)

    def solved(self, right: Array) -> Array:
        """Return the solutions (K x 6 x m) of m right sides (K x 6 x m), once factorised: 0 for what is held."""
        out, is_free = np.zeros_like(right), self.place >= 0
        place = self.place[is_free]
        for column in range(right.shape[2]):
            self.g[place] = right[is_free, :, column]
            self.solve()
            out[is_free, :, column] = self.g[place]
        return out


def optimise(T_camera_map: Array, is_held: Mask, edges: EdgeArrays) -> Array:
    """Return the poses (K x 4 x 4) that agree best with all `edges`, whose ends are row numbers of poses.

    Those that are held stay where they are; something must be held of each part that edges connect. Levenberg-Marquardt
    with Huber's weights on loops.
    """
    if is_held.all() or not len(edges.a):
        return T_camera_map
    equations = Equations(is_held, edges)
    best, damping = T_camera_map, _FIRST_DAMPING
    cost = equations.set_up(best)
    for _ in range(_MOST_STEPS):
        equations.damp(damping)
        is_definite = equations.factorise()
        if is_definite:
            equations.solve()
        trial = moved_by(best, equations.place, equations.g)
        lower = equations.set_up(trial) if is_definite else np.inf
        if lower < cost:
            gained, best, cost = cost - lower, trial, lower
            damping = max(0.1 * damping, _LEAST_DAMPING)
            if gained <= _CONVERGED * cost:
                break
        elif damping > _MOST_DAMPING or cost - lower > -1e-9 * cost:
            break
        else:
            damping *= 100.0
            equations.set_up(best)
    return best


def optimise_with_covariance(
    T_map_keyframe: dict[int, Array], held: Collection[int], edges: list[Edge], wanted: int
) -> tuple[dict[int, Array], Array]:
    """Return T_map_keyframe as `optimise` does, and the 6 x 6 covariance (`se3`) of the `wanted` one against the held.

    Raises RuntimeError where the edges do not determine the poses.
    """
    numbers = list(T_map_keyframe)
    row = {number: k for k, number in enumerate(numbers)}
    is_held = np.array([number in held for number in numbers])
    joined = EdgeArrays.of([replace(edge, a=row[edge.a], b=row[edge.b]) for edge in edges])
    best = optimise(se3.inverses(np.array(list(T_map_keyframe.values()))), is_held, joined)
    found = dict(zip(numbers, se3.inverses(best), strict=True))
    if is_held[row[wanted]]:
        return found, np.zeros((6, 6))
    equations = Equations(is_held, joined)
    equations.set_up(best)
    if not equations.factorise():
        raise RuntimeError(f"{len(edges)} registrations do not determine {len(numbers)} poses")
    unit = np.zeros((len(numbers), 6, 6))
    unit[row[wanted]] = np.eye(6)
    columns = equations.solved(unit)[row[wanted]]
    return found, 0.5 * (columns + columns.T)
