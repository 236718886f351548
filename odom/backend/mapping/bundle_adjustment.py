"""Bundle adjustment of key-frame poses, landmarks and the sensor's timing over (x/z, y/z, 1/z) measurements.

Landmarks are eliminated (Schur complement: B. Triggs et al., "Bundle adjustment - a modern synthesis", 2000); the
reduced system holds 6 unknowns for each free key frame and those of the timing. Ray and depth have a Cauchy weight
each.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from odom.backend.mapping.landmark_elimination import substitute
from odom.backend.mapping.observations import Observations
from odom.backend.mapping.schur_complement import reduce_to_poses
from odom.backend.tracking.tuning import TUNING
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask

_FIRST_DAMPING, _LEAST_DAMPING = 1e-5, 1e-10
"""Levenberg-Marquardt's damping. The least is far above what rounding does to a landmark of which only rays are known,
and far below what a second ray says of it."""
_CONVERGED = 1e-4
"""Share of the cost that a step must gain for another one to follow."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """What is adjusted: T_camera_map (K x 4 x 4), landmarks (L x 3, m, map frame), change of the timing (t).

    By the observations alone, without the prior, the timing has the information `information_timing` (t x t), and would
    still move by its inverse times `pull_timing` (t). `covariances` (L x 3 x 3, m^2) are the landmarks' given the
    poses. All are None before the first adjustment. `chi2` is the robust cost with the prior.
    """

    T_camera_map: Array
    landmarks: Array
    timing_change: Array
    information_timing: Array | None = None
    pull_timing: Array | None = None
    covariances: Array | None = None
    chi2: float = np.inf


class _System(NamedTuple):
    """The normal equations at a bundle, reduced to poses and timing, what its landmarks follow from, and the cost.

    The fields are those that `reduce_to_poses` returns.
    """

    S: Array
    rhs: Array
    V_inverse: Array
    b_landmark: Array
    W_timing: Array
    W: Array
    cost: float


def adjust(
    start: Bundle,
    is_fixed: Mask,
    observations: Observations,
    timing_information: Array,
    iterations: int,
) -> Bundle:
    """Adjust `start` to its `observations` by Levenberg-Marquardt; poses marked `is_fixed` (K) stay as they are.

    `timing_information` (t x t) is what is known of the timing beforehand: a prior on no change.
    """
    o, free = observations, np.flatnonzero(~is_fixed)
    begin = np.full(len(is_fixed), -1, dtype=np.int64)
    begin[free] = 6 * np.arange(len(free))
    poses, place = 6 * len(free), begin[o.keyframe]
    dimension = poses + len(timing_information)
    observed, cauchy = (o.keyframe, o.landmark, o.values, o.jacobian_timing, o.variances), TUNING.cauchy_chi2

    def system_at(bundle: Bundle, damping: float) -> _System:
        T_camera_map, landmarks, change = bundle.T_camera_map, bundle.landmarks, bundle.timing_change
        reduced = reduce_to_poses(T_camera_map, landmarks, change, place, dimension, observed, damping, cauchy)
        system = _System(*reduced)
        return system._replace(cost=system.cost + float(change @ timing_information @ change))

    def stepped(bundle: Bundle, system: _System, damping: float) -> Bundle | None:
        S = np.array(system.S, order="F")  # factorised in place: of some hundred frames, a copy takes 10 MB
        S.flat[:: dimension + 1] += damping * np.diag(system.S) + 1e-9
        S[poses:, poses:] += timing_information
        rhs = system.rhs.copy()
        rhs[poses:] -= timing_information @ bundle.timing_change
        try:
            factor = cho_factor(S, overwrite_a=True, check_finite=False)
        except LinAlgError:  # rounding left it indefinite
            return None
        step = cho_solve(factor, rhs, check_finite=False)
        T_camera_map = bundle.T_camera_map.copy()
        for k in free:
            T_camera_map[k] = se3.orthonormal(se3.exp(step[begin[k] : begin[k] + 6]) @ T_camera_map[k])
        eliminated = system.V_inverse, system.b_landmark, system.W_timing, system.W
        landmarks = substitute(bundle.landmarks, place, o.landmark, *eliminated, step[:poses], step[poses:])
        return Bundle(T_camera_map, landmarks, bundle.timing_change + step[poses:])

    best, damping = start, _FIRST_DAMPING
    system = system_at(best, damping)
    for _ in range(iterations):
        trial, less_damping = stepped(best, system, damping), max(0.1 * damping, _LEAST_DAMPING)
        there = None if trial is None else system_at(trial, less_damping)
        if trial is not None and there is not None and there.cost < system.cost:
            gained = system.cost - there.cost
            best, system, damping = trial, there, less_damping
            if gained < _CONVERGED * system.cost:
                break
        else:
            damping *= 100.0
            system = system_at(best, damping)
    if damping > _LEAST_DAMPING:  # the result's information must not depend on the damping that the steps ended with
        system = system_at(best, _LEAST_DAMPING)
    return _with_information(best, system, poses)


def _with_information(bundle: Bundle, system: _System, poses: int) -> Bundle:
    """Return a bundle with what the `system` there says of its timing and landmarks; `poses` unknowns are of poses."""
    S, rhs = system.S, system.rhs
    S_poses, S_across = S[:poses, :poses].copy(), S[:poses, poses:]
    S_poses.flat[:: poses + 1] += 1e-9
    of_poses = np.linalg.solve(S_poses, np.column_stack([S_across, rhs[:poses]]))
    information = S[poses:, poses:] - S_across.T @ of_poses[:, :-1]
    pull = rhs[poses:] - S_across.T @ of_poses[:, -1]
    return replace(
        bundle,
        information_timing=information,
        pull_timing=pull,
        covariances=system.V_inverse,
        chi2=system.cost,
    )


def warm_up() -> None:
    """Compile the loops, or load them, by a made-up adjustment of two frames."""
    landmarks = np.random.default_rng(0).uniform((-1.0, -1.0, 2.0), (1.0, 1.0, 4.0), (9, 3))
    values = np.repeat(np.column_stack([landmarks[:, :2], np.ones(9)]) / landmarks[:, 2:], 2, axis=0)
    order = np.arange(18)
    variances = np.tile([1e-6, 0.0, 1e-6, 1e-6], (18, 1))
    observations = Observations(order % 2, order // 2, values, np.zeros((18, 3, 3)), variances)
    bundle = Bundle(np.tile(np.eye(4), (2, 1, 1)), landmarks, np.zeros(3))
    adjust(bundle, np.array([True, False]), observations, np.eye(3), 1)
