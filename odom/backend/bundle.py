"""Bundle adjustment of key-frame poses, landmarks and the sensor's timing over (x/z, y/z, 1/z) measurements.

Landmarks are eliminated (Schur complement: B. Triggs et al., "Bundle adjustment - a modern synthesis", 2000); the
reduced system holds 6 unknowns a free key frame and those of the timing. Cauchy weights on ray and depth apart.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from odom.backend.pose import CAUCHY_CHI2, projection_terms
from odom.registration import se3
from odom.registration.compiled import compiled

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_LEAST_DAMPING = 1e-10
"""Far above what rounding does to a landmark of which only rays are known, far below what a second ray says of it."""


@dataclass(frozen=True, eq=False)
class Observations:
    """N measurements, sorted by landmark: numbers of key frame and landmark, and their values (see `Measurements`)."""

    keyframe: Index
    landmark: Index
    values: Array
    jacobian_timing: Array
    variances: Array


@dataclass(frozen=True, eq=False)
class Bundle:
    """What is adjusted: T_camera_map (K x 4 x 4), landmarks (L x 3, map frame), change of the timing (t = 3).

    `information_timing` (t x t) is what the observations alone say about the timing, and `covariances` (L x 3 x 3)
    the landmarks' given the poses; both None before the first adjustment.
    """

    T_camera_map: Array
    landmarks: Array
    timing_change: Array
    information_timing: Array | None = None
    covariances: Array | None = None


@compiled
def _robust_cost(chi2: float) -> float:
    return float(CAUCHY_CHI2 * np.log1p(chi2 / CAUCHY_CHI2))


@compiled
def _reduce(
    T_camera_map: Array,
    landmarks: Array,
    timing_change: Array,
    free: Index,
    dimension: int,
    keyframe: Index,
    landmark: Index,
    values: Array,
    jacobian_timing: Array,
    variances: Array,
    damping: float,
) -> tuple[Array, Array, Array, Array, Array, Array, float]:
    """Return the reduced system (S, rhs) and, a landmark, inv(V), b, W_timing; an observation W; and the cost."""
    N, L, timings = keyframe.shape[0], landmarks.shape[0], timing_change.shape[0]
    S = np.zeros((dimension, dimension))
    rhs = np.zeros(dimension)
    timing = dimension - timings
    W = np.zeros((N, 6, 3))
    W_timing = np.zeros((L, timings, 3))
    V_inverse = np.zeros((L, 3, 3))
    b_landmark = np.zeros((L, 3))
    J = np.zeros((3, 6))
    P = np.zeros((3, 3))
    r = np.zeros(3)
    JI = np.zeros((6, 3))
    KI = np.zeros((timings, 3))
    value = np.zeros(3)
    V = np.zeros((3, 3))
    cost = 0.0
    start = 0
    while start < N:
        point = landmark[start]
        stop = start
        V[:] = 0.0
        while stop < N and landmark[stop] == point:
            o = stop
            stop += 1
            K = jacobian_timing[o]
            for a in range(3):
                value[a] = values[o, a]
                for b in range(timings):
                    value[a] += K[a, b] * timing_change[b]
            if not projection_terms(T_camera_map[keyframe[o]], landmarks[point], value, J, P, r):
                cost += 100.0
                continue
            sxx, sxy, syy, sww = variances[o, 0], variances[o, 1], variances[o, 2], variances[o, 3]
            determinant = sxx * syy - sxy * sxy
            chi2 = (syy * r[0] * r[0] - 2.0 * sxy * r[0] * r[1] + sxx * r[1] * r[1]) / determinant
            weight = 1.0 / (1.0 + chi2 / CAUCHY_CHI2)
            cost += _robust_cost(chi2)
            ixx, ixy, iyy = syy / determinant * weight, -sxy / determinant * weight, sxx / determinant * weight
            iww = 0.0
            if value[2] > 0.0:
                chi2 = r[2] * r[2] / sww
                cost += _robust_cost(chi2)
                iww = 1.0 / (1.0 + chi2 / CAUCHY_CHI2) / sww
            for a in range(3):
                p0, p1, p2 = ixx * P[0, a] + ixy * P[1, a], ixy * P[0, a] + iyy * P[1, a], iww * P[2, a]
                b_landmark[point, a] += p0 * r[0] + p1 * r[1] + p2 * r[2]
                for b in range(3):
                    V[a, b] += p0 * P[0, b] + p1 * P[1, b] + p2 * P[2, b]
            for a in range(timings):
                KI[a, 0] = -(ixx * K[0, a] + ixy * K[1, a])
                KI[a, 1] = -(ixy * K[0, a] + iyy * K[1, a])
                KI[a, 2] = -iww * K[2, a]
                rhs[timing + a] += KI[a, 0] * r[0] + KI[a, 1] * r[1] + KI[a, 2] * r[2]
                for b in range(timings):
                    S[timing + a, timing + b] -= KI[a, 0] * K[0, b] + KI[a, 1] * K[1, b] + KI[a, 2] * K[2, b]
                for b in range(3):
                    W_timing[point, a, b] += KI[a, 0] * P[0, b] + KI[a, 1] * P[1, b] + KI[a, 2] * P[2, b]
            f = free[keyframe[o]]
            if f < 0:
                continue
            f *= 6
            for a in range(6):
                JI[a, 0] = ixx * J[0, a] + ixy * J[1, a]
                JI[a, 1] = ixy * J[0, a] + iyy * J[1, a]
                JI[a, 2] = iww * J[2, a]
                rhs[f + a] += JI[a, 0] * r[0] + JI[a, 1] * r[1] + JI[a, 2] * r[2]
                for b in range(6):
                    S[f + a, f + b] += JI[a, 0] * J[0, b] + JI[a, 1] * J[1, b] + JI[a, 2] * J[2, b]
                for b in range(3):
                    W[o, a, b] = JI[a, 0] * P[0, b] + JI[a, 1] * P[1, b] + JI[a, 2] * P[2, b]
                for b in range(timings):
                    cross = -(JI[a, 0] * K[0, b] + JI[a, 1] * K[1, b] + JI[a, 2] * K[2, b])
                    S[f + a, timing + b] += cross
                    S[timing + b, f + a] += cross
        for a in range(3):
            V[a, a] += damping * V[a, a] + 1e-9
        c00 = V[1, 1] * V[2, 2] - V[1, 2] * V[2, 1]
        c01 = V[0, 2] * V[2, 1] - V[0, 1] * V[2, 2]
        c02 = V[0, 1] * V[1, 2] - V[0, 2] * V[1, 1]
        determinant = V[0, 0] * c00 + V[1, 0] * c01 + V[2, 0] * c02
        inverse = V_inverse[point]
        inverse[0, 0], inverse[0, 1], inverse[0, 2] = c00 / determinant, c01 / determinant, c02 / determinant
        inverse[1, 1] = (V[0, 0] * V[2, 2] - V[0, 2] * V[0, 2]) / determinant
        inverse[1, 2] = (V[0, 2] * V[0, 1] - V[0, 0] * V[1, 2]) / determinant
        inverse[2, 2] = (V[0, 0] * V[1, 1] - V[0, 1] * V[0, 1]) / determinant
        inverse[1, 0], inverse[2, 0], inverse[2, 1] = inverse[0, 1], inverse[0, 2], inverse[1, 2]
        b_l = b_landmark[point]
        # The timing is one more block (t x 3) beside the key frames' (6 x 3).
        for o in range(start, stop + 1):
            is_timing = o == stop
            if is_timing:
                row, height, left = timing, timings, W_timing[point]
            else:
                row = free[keyframe[o]] * 6
                height, left = 6, W[o]
                if row < 0:
                    continue
            for a in range(height):
                y0 = left[a, 0] * inverse[0, 0] + left[a, 1] * inverse[1, 0] + left[a, 2] * inverse[2, 0]
                y1 = left[a, 0] * inverse[0, 1] + left[a, 1] * inverse[1, 1] + left[a, 2] * inverse[2, 1]
                y2 = left[a, 0] * inverse[0, 2] + left[a, 1] * inverse[1, 2] + left[a, 2] * inverse[2, 2]
                rhs[row + a] -= y0 * b_l[0] + y1 * b_l[1] + y2 * b_l[2]
                for q in range(start, stop):
                    column = free[keyframe[q]] * 6
                    if column >= 0:
                        for b in range(6):
                            S[row + a, column + b] -= y0 * W[q, b, 0] + y1 * W[q, b, 1] + y2 * W[q, b, 2]
                for b in range(timings):
                    right = W_timing[point]
                    S[row + a, timing + b] -= y0 * right[b, 0] + y1 * right[b, 1] + y2 * right[b, 2]
        start = stop
    return S, rhs, V_inverse, b_landmark, W_timing, W, cost


@compiled
def _substitute(
    landmarks: Array,
    free: Index,
    keyframe: Index,
    landmark: Index,
    V_inverse: Array,
    b_landmark: Array,
    W_timing: Array,
    W: Array,
    step: Array,
) -> Array:
    """Return the landmarks moved by their share of `step`: inv(V) (b - W' step)."""
    remainder = b_landmark.copy()
    timing = step.shape[0] - W_timing.shape[1]
    for o in range(keyframe.shape[0]):
        f = free[keyframe[o]] * 6
        if f >= 0:
            for b in range(3):
                for a in range(6):
                    remainder[landmark[o], b] -= W[o, a, b] * step[f + a]
    moved = landmarks.copy()
    for k in range(landmarks.shape[0]):
        for b in range(3):
            for a in range(W_timing.shape[1]):
                remainder[k, b] -= W_timing[k, a, b] * step[timing + a]
        for a in range(3):
            for b in range(3):
                moved[k, a] += V_inverse[k, a, b] * remainder[k, b]
    return moved


def adjust(
    start: Bundle,
    is_fixed: NDArray[np.bool_],
    observations: Observations,
    timing_information: Array,
    iterations: int,
) -> Bundle:
    """Adjust `start` to its `observations` by Levenberg-Marquardt; poses marked `is_fixed` (K) stay as they are.

    `timing_information` (t x t) is what is known of the timing beforehand; it expects no change.
    """
    free = np.full(len(is_fixed), -1, dtype=np.int64)
    free[~is_fixed] = np.arange(np.count_nonzero(~is_fixed))
    poses = 6 * int(np.count_nonzero(~is_fixed))
    dimension = poses + len(timing_information)
    o = observations
    arrays = (o.keyframe, o.landmark, o.values, o.jacobian_timing, o.variances)

    def reduced(bundle: Bundle, damping: float) -> tuple[Array, Array, Array, Array, Array, Array, float]:
        S, rhs, V_inverse, b_landmark, W_timing, W, cost = _reduce(
            bundle.T_camera_map, bundle.landmarks, bundle.timing_change, free, dimension, *arrays, damping
        )
        change = bundle.timing_change
        return S, rhs, V_inverse, b_landmark, W_timing, W, cost + float(change @ timing_information @ change)

    def moved(bundle: Bundle, S_damped: Array, gradient: Array) -> Bundle | None:
        try:
            factor = cho_factor(S_damped, overwrite_a=True, check_finite=False)
        except LinAlgError:  # rounding left it indefinite
            return None
        step = cho_solve(factor, gradient, check_finite=False)
        T_camera_map = bundle.T_camera_map.copy()
        for k in np.flatnonzero(~is_fixed):
            T_camera_map[k] = se3.orthonormal(se3.exp(step[6 * free[k] : 6 * free[k] + 6]) @ T_camera_map[k])
        landmarks = _substitute(
            bundle.landmarks, free, o.keyframe, o.landmark, V_inverse, b_landmark, W_timing, W, step
        )
        return Bundle(T_camera_map, landmarks, bundle.timing_change + step[poses:])

    damping = 1e-5
    best = start
    S, rhs, V_inverse, b_landmark, W_timing, W, cost = reduced(best, damping)
    for _ in range(iterations):
        S_damped = np.array(S, order="F")  # factorised in place: of some hundred frames, a copy takes 10 MB
        S_damped.flat[:: dimension + 1] += damping * np.diag(S) + 1e-9
        S_damped[poses:, poses:] += timing_information
        gradient = rhs.copy()
        gradient[poses:] -= timing_information @ best.timing_change
        trial, less_damping = moved(best, S_damped, gradient), max(0.1 * damping, _LEAST_DAMPING)
        system = None if trial is None else reduced(trial, less_damping)
        if trial is not None and system is not None and system[-1] < cost:
            gained = cost - system[-1]
            S, rhs, V_inverse, b_landmark, W_timing, W, cost = system
            best, damping = trial, less_damping
            if gained < 1e-4 * cost:
                break
        else:
            damping *= 100.0
            S, rhs, V_inverse, b_landmark, W_timing, W, cost = reduced(best, damping)
    if damping > _LEAST_DAMPING:  # what is known does not depend on how the steps fared
        S, _, V_inverse, *_ = reduced(best, _LEAST_DAMPING)
    S_poses, S_across = S[:poses, :poses].copy(), S[:poses, poses:]
    S_poses.flat[:: poses + 1] += 1e-9
    information = S[poses:, poses:] - S_across.T @ np.linalg.solve(S_poses, S_across)
    return Bundle(best.T_camera_map, best.landmarks, best.timing_change, information, V_inverse)
