"""The normal equations of a survey with poses, landmarks and the camera's parameters, the landmarks eliminated.

Derivatives are summed up as soon as they are computed: kept for all observations, they would be the largest thing that
a run holds. Source: B. Triggs et al., "Bundle adjustment - a modern synthesis", 2000, section 6.1.
"""

import numpy as np

from odom.backend.mapping.landmark_elimination import (
    eliminate_between,
    eliminate_from_pose,
    invert_damped,
    substitute,
)
from odom.calibration.observation_terms import PARAMETERS, CameraArrays, SeenArrays, whitened_terms
from odom.calibration.parameters import DEPTH, TIMINGS
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import moved, orthonormalise, put

_CHUNK = 256
"""Observations whose derivatives by the camera's parameters are kept until they are multiplied at once."""
_RAY = DEPTH.start
"""Parameters before this one, timing and lens, change a ray; the timing and those from this one on change depth."""


@compiled
def _add_products(rays: Array, depths: Array, timings: int, S: Array, rhs: Array) -> None:
    """Add C' C to the parameters' S (p x p), and C' r to their rhs (p).

    `rays` (2n x (q + 1)) holds C of the pixels by the first q parameters, the first `timings` of them the timing's, and
    r as its last column; `depths` the same of the depths, by all parameters but the lens's.
    """
    by_ray, by_depth = np.dot(rays.T, rays), np.dot(depths.T, depths)
    lens = len(by_ray) - 1 - timings
    for i in range(len(by_ray) - 1):
        rhs[i] += by_ray[i, -1]
        for j in range(len(by_ray) - 1):
            S[i, j] += by_ray[i, j]
    for i in range(len(by_depth) - 1):
        at = i if i < timings else i + lens
        rhs[at] += by_depth[i, -1]
        for j in range(len(by_depth) - 1):
            S[at, j if j < timings else j + lens] += by_depth[i, j]


@compiled
def reduce_survey(
    T_camera_map: Array,
    landmarks: Array,
    camera: CameraArrays,
    free: Index,
    pose: Index,
    seen: SeenArrays,
    damping: float,
    cauchy: float,
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array, float]:
    """Return the equations of poses and parameters, those of the landmarks, and the cost.

    `pose` (K) is the place of each frame's six unknowns, -1 for a fixed pose, and `free` (p) are the parameters
    of the camera that are adjusted. With poses' and parameters' unknowns x and landmarks' y, the normal equations are
    [U W; W' V] [x; y] = [a; b], V block diagonal; S = U - W inv(V) W', rhs = a - W inv(V) b. Returned are S of the
    poses (n x n, its upper half), of poses and parameters (n x p), of the parameters (p x p), both parts of rhs; for
    each landmark inv(V), b, and W' of the parameters (L x 3 x p), for each observation W' of its pose (N x 3 x 6).
    """
    frame, landmark = seen[:2]
    p, by_ray, timings = len(free), int((free < _RAY).sum()), int((free < TIMINGS).sum())
    N, L, poses = len(frame), len(landmarks), 0
    for k in range(len(pose)):
        poses = max(poses, pose[k] + 6)
    S, S_across, S_camera = np.zeros((poses, poses)), np.zeros((poses, p)), np.zeros((p, p))
    rhs, rhs_camera = np.zeros(poses), np.zeros(p)
    W, W_camera, carried = np.zeros((N, 3, 6)), np.zeros((L, 3, p)), np.zeros((L, 3, p))
    V_inverse, b, b_carried = np.zeros((L, 3, 3)), np.zeros((L, 3)), np.zeros((L, 3))
    J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, PARAMETERS)), np.zeros(3)
    rays, depths = np.zeros((2 * _CHUNK, by_ray + 1)), np.zeros((_CHUNK, p - by_ray + timings + 1))
    c_u, c_v, c_w = np.zeros(p), np.zeros(p), np.zeros(p)
    V, own = np.zeros((3, 3)), np.zeros((3, 6))
    cost, kept, start = 0.0, 0, 0
    while start < N:
        point = landmark[start]
        stop = start
        V[:] = 0.0
        while stop < N and landmark[stop] == point:
            o = stop
            stop += 1
            cost += whitened_terms(o, T_camera_map[frame[o]], landmarks[point], camera, seen, cauchy, J, P, C, r)
            r_u, r_v, r_w = r[0], r[1], r[2]
            for j in range(p):
                c_u[j], c_v[j], c_w[j] = C[0, free[j]], C[1, free[j]], C[2, free[j]]
            # V, b and W of the landmark
            for i in range(3):
                p_u, p_v, p_w = P[0, i], P[1, i], P[2, i]
                b[point, i] += p_u * r_u + p_v * r_v + p_w * r_w
                for j in range(3):
                    V[i, j] += p_u * P[0, j] + p_v * P[1, j] + p_w * P[2, j]
                row = W_camera[point, i]
                for j in range(p):
                    row[j] += p_u * c_u[j] + p_v * c_v[j] + p_w * c_w[j]
            # U and a of the parameters
            for j in range(by_ray):
                rays[2 * kept, j], rays[2 * kept + 1, j] = c_u[j], c_v[j]
            rays[2 * kept, by_ray], rays[2 * kept + 1, by_ray] = r_u, r_v
            for j in range(timings):
                depths[kept, j] = c_w[j]
            for j in range(by_ray, p):
                depths[kept, j - by_ray + timings] = c_w[j]
            depths[kept, -1] = r_w
            kept += 1
            if kept == _CHUNK:
                _add_products(rays, depths, timings, S_camera, rhs_camera)
                kept = 0
            # U and a of the pose, its block of U with the parameters, and its W
            f = pose[frame[o]]
            if f < 0:
                continue
            for i in range(6):
                j_u, j_v, j_w = J[0, i], J[1, i], J[2, i]
                rhs[f + i] += j_u * r_u + j_v * r_v + j_w * r_w
                for j in range(i, 6):
                    S[f + i, f + j] += j_u * J[0, j] + j_v * J[1, j] + j_w * J[2, j]
                row = S_across[f + i]
                for j in range(p):
                    row[j] += j_u * c_u[j] + j_v * c_v[j] + j_w * c_w[j]
                for j in range(3):
                    W[o, j, i] = j_u * P[0, j] + j_v * P[1, j] + j_w * P[2, j]
        # S -= W inv(V) W', rhs -= W inv(V) b: each pair of unknowns once, the parameters' own for all landmarks at once
        inverse = V_inverse[point]
        invert_damped(V, damping, inverse)
        W_n, carried_n = W_camera[point], carried[point]
        n_0, n_1, n_2 = W_n[0], W_n[1], W_n[2]
        for i in range(3):
            v_0, v_1, v_2 = inverse[i, 0], inverse[i, 1], inverse[i, 2]
            b_carried[point, i] = v_0 * b[point, 0] + v_1 * b[point, 1] + v_2 * b[point, 2]
            row = carried_n[i]
            for j in range(p):
                row[j] = v_0 * n_0[j] + v_1 * n_1[j] + v_2 * n_2[j]
        for o in range(start, stop):
            f = pose[frame[o]]
            if f < 0:
                continue
            eliminate_from_pose(S, rhs, f, W[o], inverse, b[point], own)
            for i in range(6):
                y_0, y_1, y_2 = own[0, i], own[1, i], own[2, i]
                row = S_across[f + i]
                for j in range(p):
                    row[j] -= y_0 * n_0[j] + y_1 * n_1[j] + y_2 * n_2[j]
            for other in range(o + 1, stop):
                g = pose[frame[other]]
                if g >= 0:
                    eliminate_between(S, f, g, own, W[other])
        start = stop
    _add_products(rays[: 2 * kept], depths[:kept], timings, S_camera, rhs_camera)
    across = W_camera.reshape(3 * L, p).T
    S_camera -= np.dot(across, carried.reshape(3 * L, p))
    rhs_camera -= np.dot(across, b_carried.reshape(3 * L))
    return S, S_across, S_camera, rhs, rhs_camera, V_inverse, b, W_camera, W, cost


@compiled
def stepped(
    T_camera_map: Array,
    landmarks: Array,
    pose: Index,
    frame: Index,
    landmark: Index,
    V_inverse: Array,
    b: Array,
    W_camera: Array,
    W: Array,
    step: Array,
    step_camera: Array,
) -> tuple[Array, Array]:
    """Return poses and landmarks after steps of poses and parameters: landmarks move by inv(V) (b - W' step)."""
    T = T_camera_map.copy()
    for k in range(len(pose)):
        if pose[k] >= 0:
            put(moved(step[pose[k] : pose[k] + 6], T_camera_map[k]), T[k])
            orthonormalise(T[k])
    points = substitute(landmarks, pose[frame], landmark, V_inverse, b, W_camera, W, step, step_camera)
    return T, points


@compiled
def scores_of(
    follows: Array,
    V_inverse: Array,
    W_camera: Array,
    W: Array,
    T_camera_map: Array,
    landmarks: Array,
    camera: CameraArrays,
    free: Index,
    pose: Index,
    seen: SeenArrays,
    cauchy: float,
) -> Array:
    """Return each observation's score (N x p): its share of the pull at the parameters `free` of the camera.

    Poses and landmarks follow each parameter: the poses by `follows` (6 free poses x p), landmarks by inv(V) (-W'
    step).
    """
    frame, landmark = seen[:2]
    N, L, p = len(frame), len(landmarks), W_camera.shape[2]
    J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, PARAMETERS)), np.zeros(3)
    # how the landmarks follow: point = inv(V) rest, rest = -W' of the parameters - W' of the poses times `follows`
    rest, point = -W_camera, np.zeros((L, 3, p))
    for o in range(N):
        f = pose[frame[o]]
        if f >= 0:
            for j in range(3):
                row = rest[landmark[o], j]
                for a in range(6):
                    pull, by_pose = W[o, j, a], follows[f + a]
                    for i in range(p):
                        row[i] -= pull * by_pose[i]
    for k in range(L):
        for a in range(3):
            for j in range(3):
                for i in range(p):
                    point[k, a, i] += V_inverse[k, a, j] * rest[k, j, i]
    # score = r' (C + P point + J follows)
    scores = np.zeros((N, p))
    for o in range(N):
        whitened_terms(o, T_camera_map[frame[o]], landmarks[landmark[o]], camera, seen, cauchy, J, P, C, r)
        f = pose[frame[o]]
        score, moved_point = scores[o], point[landmark[o]]
        for i in range(p):
            k = free[i]
            score[i] = r[0] * C[0, k] + r[1] * C[1, k] + r[2] * C[2, k]
        for j in range(3):
            pull = r[0] * P[0, j] + r[1] * P[1, j] + r[2] * P[2, j]
            for i in range(p):
                score[i] += pull * moved_point[j, i]
        if f >= 0:
            for a in range(6):
                pull = r[0] * J[0, a] + r[1] * J[1, a] + r[2] * J[2, a]
                row = follows[f + a]
                for i in range(p):
                    score[i] += pull * row[i]
    return scores
