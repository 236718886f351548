"""The least-squares problem of a marker body and a camera: hand-eye, world alignment and clock offset at once.

Model: `T_world_body(t + offset) @ T_body_camera = T_world_odom @ T_odom_camera(t) @ exp(error(t))` for every frame t
(hand-eye form A X = Y B; F. Dornaika and R. Horaud, "Simultaneous robot-world and hand-eye calibration", 1998), where
the error drifts (`drift`). Errors are averaged over groups of neighbouring frames.

The constants were chosen on arena recordings with marker bodies, whose true calibration is known: such that errors
stay within the claimed standard deviations (tests/evaluation/test_calibration.py and test_arena_truth.py).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from odom.evaluation.alignment import align
from odom.evaluation.drift import Whitener
from odom.evaluation.lever_arm import settled_axes
from odom.evaluation.pose_alignment import pose_errors
from odom.evaluation.sandwich import sandwich_sigma
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.rotations import mean_of, vectors_of

MINIMUM = 20
"""Poses that a calibration needs at least."""

_WHITENINGS = 4
"""Rounds of learning the errors' model and solving again; nothing changes after three."""
_ITERATIONS, _CONVERGED = 30, 1e-6
"""Gauss-Newton steps at most (some six are needed), ended by a smaller step (m, rad, s)."""
_GROUP_S = 1.0 / 6.0
"""Length of a group of frames: a body carried by hand moves too slowly for shorter ones to say more, and their errors
are less like what `drift` models; longer ones blur its motion. There are `MINIMUM` groups at least."""
_BLOCK_S = 5.0
"""Errors count as correlated within this time: a shorter one claims too much, a longer one leaves few blocks."""
_WILD = 15.0
"""A frame's truth is not believed beyond this ratio of its distance from the median to the median distance: smaller
leaves out brisk motion, larger lets a jump of the motion capture spoil its group."""
_OFFSET_REACH_S = 0.015
"""How far the offset may move from the first guess; beyond it, the problem is to be begun anew."""
_DERIVATIVE_S = 0.04
"""Step of the numerical derivative by the offset: over a shorter one truth's noise counts as motion, which pulls the
offset towards the first guess; over a longer one a hand's motion is not straight."""
REACH_S = _OFFSET_REACH_S + _DERIVATIVE_S
"""Truth is needed so long before and after each frame."""
_CAUCHY = 24.0
"""Squared whitened residual (6 on average) that halves a group's weight: smaller wastes data, larger lets jumps in."""
_ROUGH = 0.01
"""First guess of the errors' standard deviation (m and rad), used to choose a start and replaced by what is learnt."""
_PRIOR_SIGMA = np.array([1.0] * 3 + [3.0] * 3 + [np.inf] * 6 + [0.05])
"""Weak knowledge of X (m, rad: the camera is within metres of the markers) and of the offset (s), none of Y."""


@dataclass(frozen=True, eq=False)
class State:
    """One guess of the unknowns."""

    T_body_camera: Array
    T_world_odom: Array
    offset_s: float


@dataclass(frozen=True, eq=False)
class HandEye:
    """The frames, each with truth `REACH_S` before and after it too, and which of X (6), Y (6), offset (1) are free.

    `offset_s` is a first guess, near which the solution stays; `imposed` is the `T_body_camera` when that is not free.
    `settled` (3 x 3) projects, in the body's frame, on what turns show of the translation of X; the rest has its prior.
    """

    estimate: Trajectory
    truth: Trajectory
    offset_s: float
    imposed: Array | None
    free: Mask
    settled: Array = field(default_factory=lambda: np.eye(3))

    def solve(self, begun: State | None = None) -> tuple[State, Array]:
        """Return the solution and 13 standard deviations; the model of the errors is learnt from the errors.

        Starts from the solution `begun` elsewhere, or else from the best of three guesses.
        """
        rough = Whitener.alike(len(self.estimate) // self._group, _ROUGH)
        starts = self._starts() if begun is None else [begun]
        state = min((self._refine(start, rough) for start in starts), key=lambda s: self._cost(s, rough))
        tame = self._without_wild_frames(state)
        tame = replace(tame, settled=tame._settled(state))
        centres = tame.estimate.T_world_body[tame._group // 2 :: tame._group]
        for _ in range(_WHITENINGS):
            errors = tame._errors(state)
            whiten = Whitener.fit(errors, centres[: len(errors)])
            state = tame._refine(state, whiten)
        return state, tame._sigma(state, whiten)

    @cached_property
    def _group(self) -> int:
        period_s = float(np.median(np.diff(self.estimate.stamps))) * 1e-9
        return max(1, min(round(_GROUP_S / period_s), len(self.estimate) // MINIMUM))

    def _without_wild_frames(self, state: State) -> "HandEye":
        """Return the problem without the frames whose truth is wild, which would spoil their whole group."""
        apart = self._frame_errors(state, state.offset_s)
        apart = np.abs(apart - np.median(apart, axis=0))
        tame = np.flatnonzero((apart <= _WILD * np.median(apart, axis=0) + 1e-12).all(axis=1))
        return replace(self, estimate=self.estimate.take(tame)) if len(tame) >= MINIMUM else self

    def _settled(self, state: State) -> Array:
        R_body = self._body(state.offset_s)[:, :3, :3]
        errors = self._frame_errors(state, state.offset_s)[:, 3:] @ state.T_body_camera[:3, :3].T
        return settled_axes(R_body[:: self._group], errors[:: self._group])

    def _body(self, offset_s: float) -> Array:
        return self.truth.at(self.estimate.stamps + round(offset_s * 1e9), np.inf)[0]

    def _starts(self) -> list[State]:
        """Return three states to start from: the hand-eye rotation by relative rotations, by positions, or none."""
        W, C = self._body(self.offset_s), self.estimate.T_world_body
        if self.imposed is not None:
            hands = [self.imposed]
        else:
            stride = max(1, min(len(W) // 4, round(0.7 * len(W) / max(self.estimate.duration_s, 1e-3))))
            A = vectors_of((se3.inverses(W[:-stride]) @ W[stride:])[:, :3, :3])
            B = vectors_of((se3.inverses(C[:-stride]) @ C[stride:])[:, :3, :3])
            R_world_odom = align(C[:, :3, 3], W[:, :3, 3]).T_truth_estimate[:3, :3]
            hands = [np.eye(4) for _ in range(3)]
            hands[0][:3, :3] = align(np.vstack([B, -B]), np.vstack([A, -A])).T_truth_estimate[:3, :3]
            hands[1][:3, :3] = mean_of(W[:, :3, :3].transpose(0, 2, 1) @ R_world_odom @ C[:, :3, :3])
        states = []
        for X in hands:
            Y = np.eye(4)
            Y[:3, :3] = mean_of(W[:, :3, :3] @ X[:3, :3] @ C[:, :3, :3].transpose(0, 2, 1))
            Y[:3, 3] = ((W @ X)[:, :3, 3] - C[:, :3, 3] @ Y[:3, :3].T).mean(axis=0)
            states.append(State(X, Y, self.offset_s))
        return states

    def _frame_errors(self, state: State, offset_s: float) -> Array:
        """Return the errors of n frames, n x 6 (m, rad), each in its estimated camera frame."""
        return pose_errors(state.T_world_odom, self.estimate.T_world_body, self._body(offset_s) @ state.T_body_camera)

    def _errors(self, state: State) -> Array:
        """Return the errors of m groups, m x 6."""
        return _averaged(self._frame_errors(state, state.offset_s), self._group)

    def _jacobian(self, state: State) -> Array:
        """Return the errors' derivatives (m x 6 x k) by the free ones of 13 unknowns.

        These are xi of X exp(xi), the turn of R_Y about the world's axes, the shift of t_Y, and the offset.
        """
        R_camera_world = (state.T_world_odom[:3, :3] @ self.estimate.T_world_body[:, :3, :3]).transpose(0, 2, 1)
        turned_points = self.estimate.positions @ state.T_world_odom[:3, :3].T
        J = np.zeros((len(self.estimate), 6, 13))
        R_hand = state.T_body_camera[:3, :3]
        J[:, :, :6] = np.eye(6)
        J[:, :3, :3] = R_hand.T @ self.settled @ R_hand
        J[:, :3, 6:9] = np.cross(R_camera_world, turned_points[:, None, :])
        J[:, 3:, 6:9] = J[:, :3, 9:12] = -R_camera_world
        later, sooner = (self._frame_errors(state, state.offset_s + h) for h in (_DERIVATIVE_S, -_DERIVATIVE_S))
        J[:, :, 12] = (later - sooner) / (2 * _DERIVATIVE_S)
        return _averaged(J[:, :, self.free], self._group)

    def _normal_equations(self, state: State, whiten: Whitener) -> tuple[Array, Array, Array]:
        """Return H, g and the groups' scores (m x k) of the Cauchy-weighted problem with its weak prior."""
        r = whiten(self._errors(state)[:, :, None])[:, :, 0]
        J = whiten(self._jacobian(state))
        weights = 1.0 / (1.0 + np.square(r).sum(axis=1) / _CAUCHY)
        H = np.einsum("n,nij,nik->jk", weights, J, J)
        scores = -np.einsum("n,nij,ni->nj", weights, J, r)
        held = np.zeros(13)
        held[:3] = state.T_body_camera[:3, :3].T @ state.T_body_camera[:3, 3]
        information = 1.0 / np.square(_PRIOR_SIGMA)
        return H + np.diag(information[self.free]), scores.sum(axis=0) - (information * held)[self.free], scores

    def _refine(self, state: State, whiten: Whitener) -> State:
        """Return the state after Gauss-Newton steps to convergence."""
        for _ in range(_ITERATIONS):
            H, g, _ = self._normal_equations(state, whiten)
            step = np.zeros(13)
            step[self.free] = np.linalg.solve(H, g)
            Y = state.T_world_odom.copy()
            Y[:3, :3] = se3.so3_exp(step[6:9]) @ Y[:3, :3]
            Y[:3, 3] += step[9:12]
            offset = float(
                np.clip(state.offset_s + step[12], self.offset_s - _OFFSET_REACH_S, self.offset_s + _OFFSET_REACH_S)
            )
            step[12] = offset - state.offset_s
            state = State(state.T_body_camera @ se3.exp(step[:6]), Y, offset)
            if np.abs(step).max() < _CONVERGED:
                break
        return state

    def _cost(self, state: State, whiten: Whitener) -> float:
        """Return the robust cost of a state, to choose between starts."""
        r = whiten(self._errors(state)[:, :, None])
        return float(np.log1p(np.square(r).sum(axis=1) / _CAUCHY).sum())

    def _sigma(self, state: State, whiten: Whitener) -> Array:
        """Return 13 standard deviations, 0 for what is not free; errors count as correlated within blocks of 5 s.

        They allow for a model that is learnt from n errors of 6 numbers, left by the unknowns: the inverse of their
        covariance is too large by n / (n - 7) on average (J. Hartlap, P. Simon and P. Schneider, "Why your model
        parameter confidences might be too small", 2007), and the solution weighted by it spreads about as much wider
        (S. Dodelson and M. Schneider, "The effect of covariance estimator error on cosmological parameter constraints",
        2013).
        """
        H, _, scores = self._normal_equations(state, whiten)
        n = len(scores)
        per_block = max(1, round(_BLOCK_S * n / max(self.estimate.duration_s, 1e-3)))
        out = np.zeros(13)
        out[self.free] = sandwich_sigma(H, scores, max(n // per_block, 2))
        return np.asarray(out * n / (n - 7) * np.sqrt(n / (n - np.count_nonzero(self.free) / 6)))


def _averaged(rows: Array, group: int) -> Array:
    whole = len(rows) // group * group
    return np.asarray(rows[:whole].reshape(-1, group, *rows.shape[1:]).mean(axis=1))
