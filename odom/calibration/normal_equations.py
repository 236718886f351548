"""The normal equations of a survey with poses, landmarks and the camera's numbers, the landmarks eliminated.

Derivatives are computed observation by observation and summed up at once: kept for all of them, they would be the
largest thing that a run holds. Source: B. Triggs et al., "Bundle adjustment - a modern synthesis", 2000, section 6.1.
"""

import numpy as np

from odom.backend.mapping.landmark_elimination import invert_damped, mirror_upper
from odom.calibration.observation_terms import CameraArrays, SeenArrays, whitened_terms
from odom.calibration.parameters import DEPTH
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import moved, orthonormalise, put

_DEPTH = DEPTH.start


@compiled
def _subtract(S: Array, row: int, column: int, left: Array, right: Array) -> None:
    """Subtract left' right from the block of S that begins at `row`, `column`; `left` (3 x n), `right` (3 x m)."""
    n, m = left.shape[1], right.shape[1]
    block = S[row : row + n, column : column + m]
    for i in range(n):
        l0, l1, l2 = left[0, i], left[1, i], left[2, i]
        for j in range(m):
            block[i, j] -= l0 * right[0, j] + l1 * right[1, j] + l2 * right[2, j]


@compiled
def _eliminate(S: Array, rhs: Array, place: int, W: Array, inverse: Array, b: Array, carried: Array) -> None:
    """Subtract W inv(V) W' from the block of S at `place` on the diagonal, and W inv(V) b from rhs.

    From one side of the diagonal alone. `W` is W' (3 x n); fills `carried` (3 x n) with inv(V) W'.
    """
    n = W.shape[1]
    block = S[place : place + n, place : place + n]
    for i in range(n):
        w0, w1, w2 = W[0, i], W[1, i], W[2, i]
        c0 = w0 * inverse[0, 0] + w1 * inverse[1, 0] + w2 * inverse[2, 0]
        c1 = w0 * inverse[0, 1] + w1 * inverse[1, 1] + w2 * inverse[2, 1]
        c2 = w0 * inverse[0, 2] + w1 * inverse[1, 2] + w2 * inverse[2, 2]
        carried[0, i], carried[1, i], carried[2, i] = c0, c1, c2
        rhs[place + i] -= c0 * b[0] + c1 * b[1] + c2 * b[2]
        for j in range(i, n):
            block[i, j] -= c0 * W[0, j] + c1 * W[1, j] + c2 * W[2, j]


@compiled
def reduce_survey(
    T_camera_map: Array,
    landmarks: Array,
    camera: CameraArrays,
    pose: Index,
    seen: SeenArrays,
    damping: float,
    cauchy: float,
) -> tuple[Array, Array, Array, Array, Array, Array, float]:
    """Return the reduced system (S, rhs); for each landmark inv(V), b, W_number; for each observation W; and the cost.

    `pose` (K) is the place of each frame's six unknowns in S, -1 for a pose that is held; behind the poses come the
    camera's numbers. With poses' and numbers' unknowns x and landmarks' y, the normal equations
    are [U W; W' V] [x; y] = [a; b], V block diagonal; S = U - W inv(V) W', rhs = a - W inv(V) b. W is returned as W',
    for each observation the columns of its pose (N x 3 x 6), for each landmark those of the numbers (L x 3 x p).
    """
    (_, _, _, column), (frame, landmark) = camera, seen[:2]
    N, L, numbers, plain, poses = len(frame), len(landmarks), 0, 0, 0
    for k in range(len(column)):
        numbers += column[k] >= 0
        plain += k < _DEPTH and column[k] >= 0  # those of timing and lens stand before those of the depth model
    for k in range(len(pose)):
        poses = max(poses, pose[k] + 6)
    dimension = poses + numbers
    S, rhs = np.zeros((dimension, dimension)), np.zeros(dimension)
    W, W_number = np.zeros((N, 3, 6)), np.zeros((L, 3, numbers))
    V_inverse, b = np.zeros((L, 3, 3)), np.zeros((L, 3))
    J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, numbers)), np.zeros(3)
    own, all_numbers = np.zeros((3, 6)), np.zeros((3, numbers))
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
            cost += whitened_terms(o, T_camera_map[frame[o]], landmarks[point], camera, seen, cauchy, J, P, C, r)
            # V, b and W of the landmark
            for i in range(3):
                b[point, i] += P[0, i] * r[0] + P[1, i] * r[1] + P[2, i] * r[2]
                for j in range(3):
                    V[i, j] += P[0, i] * P[0, j] + P[1, i] * P[1, j] + P[2, i] * P[2, j]
            # U and a of the numbers, and their W; what the lens does to depth, and the depth model to the pixel, is 0
            for i in range(numbers):
                c0, c1, c2 = C[0, i], C[1, i], C[2, i]
                rhs[poses + i] += c0 * r[0] + c1 * r[1] + c2 * r[2]
                row = S[poses + i, poses:]
                for j in range(i, plain):
                    row[j] += c0 * C[0, j] + c1 * C[1, j]
                if c2 != 0.0:
                    for j in range(i, numbers):
                        row[j] += c2 * C[2, j]
                for j in range(3):
                    W_number[point, j, i] += c0 * P[0, j] + c1 * P[1, j] + c2 * P[2, j]
            # U and a of the pose, its block of U with the numbers, and its W
            f = pose[frame[o]]
            if f < 0:
                continue
            for i in range(6):
                j0, j1, j2 = J[0, i], J[1, i], J[2, i]
                rhs[f + i] += j0 * r[0] + j1 * r[1] + j2 * r[2]
                for j in range(i, 6):
                    S[f + i, f + j] += j0 * J[0, j] + j1 * J[1, j] + j2 * J[2, j]
                row = S[f + i, poses:]
                for j in range(plain):
                    row[j] += j0 * C[0, j] + j1 * C[1, j]
                if j2 != 0.0:
                    for j in range(numbers):
                        row[j] += j2 * C[2, j]
                for j in range(3):
                    W[o, j, i] = j0 * P[0, j] + j1 * P[1, j] + j2 * P[2, j]
        inverse = V_inverse[point]
        invert_damped(V, damping, inverse)
        # S -= W inv(V) W', rhs -= W inv(V) b: each pair of unknowns once
        for o in range(start, stop):
            f = pose[frame[o]]
            if f >= 0:
                _eliminate(S, rhs, f, W[o], inverse, b[point], own)
                for other in range(o + 1, stop):
                    g = pose[frame[other]]
                    if g >= 0:
                        _subtract(S, f, g, own, W[other])
                _subtract(S, f, poses, own, W_number[point])
        _eliminate(S, rhs, poses, W_number[point], inverse, b[point], all_numbers)
        start = stop
    mirror_upper(S)
    return S, rhs, V_inverse, b, W_number, W, cost


@compiled
def stepped(
    T_camera_map: Array,
    landmarks: Array,
    pose: Index,
    frame: Index,
    landmark: Index,
    V_inverse: Array,
    b: Array,
    W_number: Array,
    W: Array,
    step: Array,
) -> tuple[Array, Array]:
    """Return poses and landmarks after a `step` of poses and numbers: landmarks move by inv(V) (b - W' step)."""
    K, numbers = len(pose), W_number.shape[2]
    T = T_camera_map.copy()
    for k in range(K):
        if pose[k] >= 0:
            put(moved(step[pose[k] : pose[k] + 6], T_camera_map[k]), T[k])
            orthonormalise(T[k])
    points = landmarks.copy()
    rest = b.copy()
    for o in range(len(frame)):
        f = pose[frame[o]]
        if f >= 0:
            for j in range(3):
                for i in range(6):
                    rest[landmark[o], j] -= W[o, j, i] * step[f + i]
    last = len(step) - numbers
    for k in range(len(landmarks)):
        for j in range(3):
            for i in range(numbers):
                rest[k, j] -= W_number[k, j, i] * step[last + i]
        for i in range(3):
            for j in range(3):
                points[k, i] += V_inverse[k, i, j] * rest[k, j]
    return T, points


@compiled
def scores_of(
    follows: Array,
    V_inverse: Array,
    W_number: Array,
    W: Array,
    T_camera_map: Array,
    landmarks: Array,
    camera: CameraArrays,
    pose: Index,
    seen: SeenArrays,
    cauchy: float,
) -> Array:
    """Return each observation's pull at the camera's numbers (N x p); poses and landmarks follow every number.

    `follows` (6 free poses x p) is how the poses do; the landmarks do by inv(V) (-W' step).
    """
    frame, landmark = seen[:2]
    N, L, numbers = len(frame), len(landmarks), W_number.shape[2]
    J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, numbers)), np.zeros(3)
    rest, point = -W_number, np.zeros((L, 3, numbers))
    for o in range(N):
        f = pose[frame[o]]
        if f >= 0:
            for j in range(3):
                row = rest[landmark[o], j]
                for a in range(6):
                    pull, by_pose = W[o, j, a], follows[f + a]
                    for i in range(numbers):
                        row[i] -= pull * by_pose[i]
    for k in range(L):
        for a in range(3):
            for j in range(3):
                for i in range(numbers):
                    point[k, a, i] += V_inverse[k, a, j] * rest[k, j, i]
    scores = np.zeros((N, numbers))
    for o in range(N):
        whitened_terms(o, T_camera_map[frame[o]], landmarks[landmark[o]], camera, seen, cauchy, J, P, C, r)
        f = pose[frame[o]]
        score, moved_point = scores[o], point[landmark[o]]
        for i in range(numbers):
            score[i] = r[0] * C[0, i] + r[1] * C[1, i] + r[2] * C[2, i]
        for j in range(3):
            pull = r[0] * P[0, j] + r[1] * P[1, j] + r[2] * P[2, j]
            for i in range(numbers):
                score[i] += pull * moved_point[j, i]
        if f >= 0:
            for a in range(6):
                pull = r[0] * J[0, a] + r[1] * J[1, a] + r[2] * J[2, a]
                row = follows[f + a]
                for i in range(numbers):
                    score[i] += pull * row[i]
    return scores
