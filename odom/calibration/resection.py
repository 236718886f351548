"""Poses fitted to landmarks that stay (resection), and landmarks to poses that stay (intersection), compiled."""

import numpy as np

from odom.backend.mapping.landmark_elimination import invert_damped
from odom.calibration.observation_terms import PARAMETERS, CameraArrays, SeenArrays, whitened_terms
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import moved, orthonormalise, put, solve_definite

_PRIOR = 1e-6
"""Information (1/m^2, 1/rad^2) that keeps a pose of which nothing was measured; otherwise it has no effect."""


@compiled
def resected(
    T_camera_map: Array,
    landmarks: Array,
    camera: CameraArrays,
    pose: Index,
    seen: SeenArrays,
    steps: int,
    cauchy: float,
) -> Array:
    """Return poses (K x 4 x 4): those not negative in `pose` (K) are each fitted alone to fixed landmarks."""
    K, frame, landmark = len(pose), seen[0], seen[1]
    J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, PARAMETERS)), np.zeros(3)
    T = T_camera_map.copy()
    for _ in range(steps):
        H, g = np.zeros((K, 6, 6)), np.zeros((K, 6))
        for o in range(len(frame)):
            k = frame[o]
            if pose[k] < 0:
                continue
            whitened_terms(o, T[k], landmarks[landmark[o]], camera, seen, cauchy, J, P, C, r)
            for i in range(6):
                g[k, i] += J[0, i] * r[0] + J[1, i] * r[1] + J[2, i] * r[2]
                for j in range(6):
                    H[k, i, j] += J[0, i] * J[0, j] + J[1, i] * J[1, j] + J[2, i] * J[2, j]
        for k in range(K):
            if pose[k] >= 0:
                for i in range(6):
                    H[k, i, i] += _PRIOR
                put(moved(solve_definite(H[k], g[k]), T[k]), T[k])
                orthonormalise(T[k])
    return T


@compiled
def intersected(
    T_camera_map: Array, landmarks: Array, camera: CameraArrays, seen: SeenArrays, damping: float, cauchy: float
) -> Array:
    """Return landmarks (L x 3): each is fitted alone to fixed poses, by one step with `damping`."""
    L, frame, landmark = len(landmarks), seen[0], seen[1]
    J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, PARAMETERS)), np.zeros(3)
    V, b, inverse, moved_to = np.zeros((L, 3, 3)), np.zeros((L, 3)), np.zeros((3, 3)), landmarks.copy()
    for o in range(len(frame)):
        k = landmark[o]
        whitened_terms(o, T_camera_map[frame[o]], landmarks[k], camera, seen, cauchy, J, P, C, r)
        for i in range(3):
            b[k, i] += P[0, i] * r[0] + P[1, i] * r[1] + P[2, i] * r[2]
            for j in range(3):
                V[k, i, j] += P[0, i] * P[0, j] + P[1, i] * P[1, j] + P[2, i] * P[2, j]
    for k in range(L):
        invert_damped(V[k], damping, inverse)
        for i in range(3):
            for j in range(3):
                moved_to[k, i] += inverse[i, j] * b[k, j]
    return moved_to
