"""The normal equations of a pose graph, in a compiled loop: the sum over registrations, with robust loop closures.

A registration T_a_b of information W has the residual r = log(inv(T_a_b) D), D = inv(T_a) T_b. With T <- T exp(xi) its
derivatives are J by xi_b and -J Ad(inv(D)) by xi_a, J = I + ad(r) / 2 + ad(r)^2 / 12, the inverse right Jacobian
(J. Sola et al., "A micro Lie theory", 2018, eq. 144 and appendix D; the series is exact to the third order). Poses are
given as T_camera_map, the inverse of T.
"""

import math

import numpy as np

from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import moved, put


@compiled
def _residual(T_a_map: Array, T_b_map: Array, T_a_b: Array, D: Array, r: Array) -> None:
    """Set `D` (3 x 4) to the motion between two poses and `r` (6, translation first) to log(inv(T_a_b) D)."""
    # D = T_a_map inv(T_b_map), E = inv(T_a_b) D
    for i in range(3):
        for j in range(3):
            D[i, j] = T_a_map[i, 0] * T_b_map[j, 0] + T_a_map[i, 1] * T_b_map[j, 1] + T_a_map[i, 2] * T_b_map[j, 2]
        D[i, 3] = T_a_map[i, 3] - D[i, 0] * T_b_map[0, 3] - D[i, 1] * T_b_map[1, 3] - D[i, 2] * T_b_map[2, 3]
    E = np.zeros((3, 4))
    for i in range(3):
        for j in range(4):
            E[i, j] = T_a_b[0, i] * D[0, j] + T_a_b[1, i] * D[1, j] + T_a_b[2, i] * D[2, j]
        E[i, 3] -= T_a_b[0, i] * T_a_b[0, 3] + T_a_b[1, i] * T_a_b[1, 3] + T_a_b[2, i] * T_a_b[2, 3]
    # log(E): the rotation vector (x, y, z), and inv(V) t = t - w x t / 2 + c w x (w x t) of the translation t
    sx, sy, sz = 0.5 * (E[2, 1] - E[1, 2]), 0.5 * (E[0, 2] - E[2, 0]), 0.5 * (E[1, 0] - E[0, 1])
    sine = math.sqrt(sx * sx + sy * sy + sz * sz)
    angle = math.atan2(sine, 0.5 * (E[0, 0] + E[1, 1] + E[2, 2] - 1.0))
    scale = angle / sine if sine > 1e-9 else 1.0
    x, y, z = scale * sx, scale * sy, scale * sz
    c = 1.0 / 12.0
    if angle > 1e-3:
        c = (1.0 - 0.5 * angle * sine / (1.0 - math.cos(angle))) / (angle * angle)
    tx, ty, tz = E[0, 3], E[1, 3], E[2, 3]
    ux, uy, uz = y * tz - z * ty, z * tx - x * tz, x * ty - y * tx
    r[0] = tx - 0.5 * ux + c * (y * uz - z * uy)
    r[1] = ty - 0.5 * uy + c * (z * ux - x * uz)
    r[2] = tz - 0.5 * uz + c * (x * uy - y * ux)
    r[3], r[4], r[5] = x, y, z


@compiled
def _add_hat(out: Array, row: int, column: int, x: float, y: float, z: float) -> None:
    out[row, column + 1] -= z
    out[row, column + 2] += y
    out[row + 1, column] += z
    out[row + 1, column + 2] -= x
    out[row + 2, column] -= y
    out[row + 2, column + 1] += x


@compiled
def _derivatives(D: Array, r: Array, J_a: Array, J_b: Array) -> None:
    """Set the residual's derivatives (6 x 6) by the perturbations of both poses; `D` is the motion between them."""
    ad = np.zeros((6, 6))
    _add_hat(ad, 0, 0, r[3], r[4], r[5])
    _add_hat(ad, 3, 3, r[3], r[4], r[5])
    _add_hat(ad, 0, 3, r[0], r[1], r[2])
    for i in range(6):
        for j in range(6):
            squared = 0.0
            for c in range(6):
                squared += ad[i, c] * ad[c, j]
            J_b[i, j] = 0.5 * ad[i, j] + squared / 12.0 + (1.0 if i == j else 0.0)
    A = np.zeros((6, 6))
    for i in range(3):
        for j in range(3):
            A[i, j] = A[i + 3, j + 3] = D[j, i]
    t = D[:, 3]  # of Ad(inv(D)) the upper right block is -R' hat(t)
    for i in range(3):
        A[i, 3] = -(D[1, i] * t[2] - D[2, i] * t[1])
        A[i, 4] = -(D[2, i] * t[0] - D[0, i] * t[2])
        A[i, 5] = -(D[0, i] * t[1] - D[1, i] * t[0])
    for i in range(6):
        for j in range(6):
            total = 0.0
            for c in range(6):
                total += J_b[i, c] * A[c, j]
            J_a[i, j] = -total


@compiled
def accumulate(
    T_camera_map: Array,
    edges: tuple[Index, Index, Array, Array, Mask],
    bound: float,
    place: Index,
    start: Index,
    slots: tuple[Index, Mask],
    L: Array,
    g: Array,
) -> float:
    """Add up the lower triangle `L` of the normal equations (by `BlockPattern`) and `g` (n x 6); return the cost.

    `edges` are the registrations' ends a and b, T_a_b, information and whether they close a loop, which then counts by
    Huber's weight from `bound` sigmas on. `place` (K) is a pose's row in the equations, negative where it is held;
    `slots` say where in `L` the block between the two ends goes, and whether transposed.
    """
    a, b, T_a_b, information, is_loop = edges
    slot, is_turned = slots
    L[:] = 0.0
    g[:] = 0.0
    D, r = np.zeros((3, 4)), np.zeros(6)
    J_a, J_b, WJ_a, WJ_b, Wr = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6)
    cost = 0.0
    for e in range(len(a)):
        _residual(T_camera_map[a[e]], T_camera_map[b[e]], T_a_b[e], D, r)
        # W r, chi2 = r' W r and the robust cost
        W = information[e]
        chi2 = 0.0
        for i in range(6):
            Wr[i] = 0.0
            for c in range(6):
                Wr[i] += W[i, c] * r[c]
            chi2 += r[i] * Wr[i]
        weight = 1.0
        if is_loop[e] and chi2 > bound * bound:
            sigmas = math.sqrt(chi2)
            weight = bound / sigmas
            cost += bound * (2.0 * sigmas - bound)
        else:
            cost += chi2
        # W J by each pose, with the robust weight
        _derivatives(D, r, J_a, J_b)
        for i in range(6):
            for j in range(6):
                by_a = by_b = 0.0
                for c in range(6):
                    by_a += W[i, c] * J_a[c, j]
                    by_b += W[i, c] * J_b[c, j]
                WJ_a[i, j], WJ_b[i, j] = weight * by_a, weight * by_b
        # g -= J' W r, and J' W J into the blocks of a, of b and between the two
        at_a, at_b = place[a[e]], place[b[e]]
        for i in range(6):
            for c in range(6):
                if at_a >= 0:
                    g[at_a, i] -= weight * J_a[c, i] * Wr[c]
                if at_b >= 0:
                    g[at_b, i] -= weight * J_b[c, i] * Wr[c]
            for j in range(6):
                own_a = own_b = across = 0.0
                for c in range(6):
                    own_a += J_a[c, i] * WJ_a[c, j]
                    own_b += J_b[c, i] * WJ_b[c, j]
                    across += J_a[c, i] * WJ_b[c, j]
                if at_a >= 0:
                    L[start[at_a], i, j] += own_a
                if at_b >= 0:
                    L[start[at_b], i, j] += own_b
                if at_a >= 0 and at_b >= 0:
                    if is_turned[e]:
                        L[slot[e], j, i] += across
                    else:
                        L[slot[e], i, j] += across
    return cost


@compiled
def moved_by(T_camera_map: Array, place: Index, steps: Array) -> Array:
    """Return the poses after T <- T exp(xi), xi the row of `steps` (n x 6) at each one's `place`; negative: none."""
    out = T_camera_map.copy()
    for k in range(len(place)):
        if place[k] >= 0:
            put(moved(-steps[place[k]], T_camera_map[k]), out[k])
    return out
