"""What moves with key frames that are given new poses, in compiled loops: a closed loop moves thousands of them."""

import numpy as np

from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled


@compiled
def changes_in_map(before: Array, after: Array) -> Array:
    """Return how the surroundings of key frames move in the map (n x 4 x 4) when T_camera_map changes (both n x 4 x 4).

    That is inv(after) before.
    """
    out = np.zeros((len(after), 4, 4))
    for n in range(len(after)):
        A, B = after[n], before[n]
        for i in range(3):
            for j in range(4):
                out[n, i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]
            out[n, i, 3] -= A[0, i] * A[0, 3] + A[1, i] * A[1, 3] + A[2, i] * A[2, 3]
        out[n, 3, 3] = 1.0
    return out


@compiled
def followed(T_camera_map: Array, T_new_old: Array, which: Index) -> Array:
    """Return the poses (n x 4 x 4) after the map around each has moved by the row `which` (n) of `T_new_old`.

    That is T_camera_map inv(T_new_old); rotations that rounding has bent are straightened (one Newton step).
    """
    out = np.zeros((len(T_camera_map), 4, 4))
    R = np.zeros((3, 3))
    for n in range(len(T_camera_map)):
        C, M = T_camera_map[n], T_new_old[which[n]]
        for i in range(3):
            for j in range(3):
                R[i, j] = C[i, 0] * M[j, 0] + C[i, 1] * M[j, 1] + C[i, 2] * M[j, 2]
        for i in range(3):
            out[n, i, 3] = C[i, 3] - R[i, 0] * M[0, 3] - R[i, 1] * M[1, 3] - R[i, 2] * M[2, 3]
            for j in range(3):
                bent = 0.0
                for k in range(3):
                    bent += R[i, k] * (R[0, k] * R[0, j] + R[1, k] * R[1, j] + R[2, k] * R[2, j])
                out[n, i, j] = 1.5 * R[i, j] - 0.5 * bent
        out[n, 3, 3] = 1.0
    return out


@compiled
def carry_landmarks(
    T_new_old: Array, row_of: Index, keyframe: Index, follows: Mask, position: Array, covariance: Array
) -> None:
    """Move the landmarks that `follows` (n) marks with the key frame that saw them first.

    `row_of` is a key frame's row in `T_new_old`, by its number, negative where it stays.
    """
    M = np.zeros((3, 3))
    for n in range(len(keyframe)):
        if not follows[n] or row_of[keyframe[n]] < 0:
            continue
        T = T_new_old[row_of[keyframe[n]]]
        x, y, z = position[n, 0], position[n, 1], position[n, 2]
        for i in range(3):
            position[n, i] = T[i, 0] * x + T[i, 1] * y + T[i, 2] * z + T[i, 3]
            for j in range(3):
                M[i, j] = T[i, 0] * covariance[n, 0, j] + T[i, 1] * covariance[n, 1, j] + T[i, 2] * covariance[n, 2, j]
        for i in range(3):
            for j in range(3):
                covariance[n, i, j] = M[i, 0] * T[j, 0] + M[i, 1] * T[j, 1] + M[i, 2] * T[j, 2]
