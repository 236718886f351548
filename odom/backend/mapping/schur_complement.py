"""The normal equations of a bundle adjustment, with the landmarks eliminated (Schur complement), in compiled loops.

Source: B. Triggs et al., "Bundle adjustment - a modern synthesis", 2000, section 6.1.
"""

import numpy as np

from odom.backend.mapping.landmark_elimination import BEHIND_CAMERA_COST, invert_damped, longest_run, mirror_upper
from odom.backend.tracking.pose_solver import projection_terms
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled


@compiled
def _robust_cost(chi2: float, cauchy: float) -> float:
    """Return Cauchy's cost of a residual, whose derivative is the weight 1 / (1 + chi2 / cauchy)."""
    return float(cauchy * np.log1p(chi2 / cauchy))


@compiled
def reduce_to_poses(
    T_camera_map: Array,
    landmarks: Array,
    timing_change: Array,
    place: Index,
    dimension: int,
    observed: tuple[Index, Index, Array, Array, Array],
    damping: float,
    cauchy: float,
) -> tuple[Array, Array, Array, Array, Array, Array, float]:
    """Return the reduced system (S, rhs); for each landmark inv(V), b, W_timing; for each observation W; and the cost.

    With poses' and timing's unknowns x and landmarks' y, the normal equations are [U W; W' V] [x; y] = [a; b], V block
    diagonal. For each landmark its share of U, W, V, a, b is summed up over its observations, and y is eliminated:
    S = U - W inv(V) W', rhs = a - W inv(V) b. W is returned as W' (N x 3 x 6; of the timing L x 3 x t). `observed` are
    the fields of the `Observations`. `place` (N) is where the unknowns of an observation's pose begin, -1 for one that
    is held. J, P, K: derivatives of an observation by pose, landmark and timing.
    """
    keyframe, landmark, values, jacobian_timing, variances = observed
    N, L, timings = keyframe.shape[0], landmarks.shape[0], timing_change.shape[0]
    S = np.zeros((dimension, dimension))
    rhs = np.zeros(dimension)
    timing = dimension - timings
    W = np.zeros((N, 3, 6))
    W_timing = np.zeros((L, 3, timings))
    V_inverse = np.zeros((L, 3, 3))
    b_landmark = np.zeros((L, 3))
    J = np.zeros((3, 6))
    P = np.zeros((3, 3))
    r = np.zeros(3)
    JI = np.zeros((6, 3))
    KI = np.zeros((timings, 3))
    value = np.zeros(3)
    V = np.zeros((3, 3))
    most = longest_run(landmark)
    width = 6 * most + timings
    across_0, across_1, across_2 = np.zeros(width), np.zeros(width), np.zeros(width)
    row_of, begin = np.zeros(width, np.int64), np.zeros(most + 2, np.int64)
    cost = 0.0
    start = 0
    while start < N:
        point = landmark[start]
        stop = start
        V[:] = 0.0
        while stop < N and landmark[stop] == point:
            o = stop
            stop += 1
            # the observation carried to the present timing, and its residual r
            K = jacobian_timing[o]
            for a in range(3):
                value[a] = values[o, a]
                for b in range(timings):
                    value[a] += K[a, b] * timing_change[b]
            if not projection_terms(T_camera_map[keyframe[o]], landmarks[point], value, J, P, r):
                cost += BEHIND_CAMERA_COST
                continue
            # its robust information: ixx, ixy, iyy of the ray, iww of the inverse depth (0 where not measured)
            sxx, sxy, syy, sww = variances[o, 0], variances[o, 1], variances[o, 2], variances[o, 3]
            determinant = sxx * syy - sxy * sxy
            chi2 = (syy * r[0] * r[0] - 2.0 * sxy * r[0] * r[1] + sxx * r[1] * r[1]) / determinant
            weight = 1.0 / (1.0 + chi2 / cauchy)
            cost += _robust_cost(chi2, cauchy)
            ixx, ixy, iyy = syy / determinant * weight, -sxy / determinant * weight, sxx / determinant * weight
            iww = 0.0
            if value[2] > 0.0:
                chi2 = r[2] * r[2] / sww
                cost += _robust_cost(chi2, cauchy)
                iww = 1.0 / (1.0 + chi2 / cauchy) / sww
            # V += P' I P and b += P' I r of the landmark
            for a in range(3):
                p0, p1, p2 = ixx * P[0, a] + ixy * P[1, a], ixy * P[0, a] + iyy * P[1, a], iww * P[2, a]
                b_landmark[point, a] += p0 * r[0] + p1 * r[1] + p2 * r[2]
                for b in range(3):
                    V[a, b] += p0 * P[0, b] + p1 * P[1, b] + p2 * P[2, b]
            # U, W and a of the timing, whose derivative of the residual is -K
            for a in range(timings):
                KI[a, 0] = -(ixx * K[0, a] + ixy * K[1, a])
                KI[a, 1] = -(ixy * K[0, a] + iyy * K[1, a])
                KI[a, 2] = -iww * K[2, a]
                rhs[timing + a] += KI[a, 0] * r[0] + KI[a, 1] * r[1] + KI[a, 2] * r[2]
                for b in range(a, timings):
                    S[timing + a, timing + b] -= KI[a, 0] * K[0, b] + KI[a, 1] * K[1, b] + KI[a, 2] * K[2, b]
                for b in range(3):
                    W_timing[point, b, a] += KI[a, 0] * P[0, b] + KI[a, 1] * P[1, b] + KI[a, 2] * P[2, b]
            # U, W and a of the key frame's pose, and its block of U with the timing
            f = place[o]
            if f < 0:
                continue
            for a in range(6):
                JI[a, 0] = ixx * J[0, a] + ixy * J[1, a]
                JI[a, 1] = ixy * J[0, a] + iyy * J[1, a]
                JI[a, 2] = iww * J[2, a]
                rhs[f + a] += JI[a, 0] * r[0] + JI[a, 1] * r[1] + JI[a, 2] * r[2]
                for b in range(a, 6):
                    S[f + a, f + b] += JI[a, 0] * J[0, b] + JI[a, 1] * J[1, b] + JI[a, 2] * J[2, b]
                for b in range(3):
                    W[o, b, a] = JI[a, 0] * P[0, b] + JI[a, 1] * P[1, b] + JI[a, 2] * P[2, b]
                for b in range(timings):
                    S[f + a, timing + b] -= JI[a, 0] * K[0, b] + JI[a, 1] * K[1, b] + JI[a, 2] * K[2, b]
        inverse = V_inverse[point]
        invert_damped(V, damping, inverse)
        b_l = b_landmark[point]
        # S -= W inv(V) W', rhs -= W inv(V) b: poses (3 x 6) and timing (3 x t), whose W' lie side by side in `across`,
        # in runs of poses that follow each other; each pair is computed once
        width, runs = 0, 0
        for o in range(start, stop + 1):
            row = timing if o == stop else place[o]
            if row >= 0:
                left = W_timing[point] if o == stop else W[o]
                if width == 0 or row != row_of[width - 1] + 1:
                    begin[runs] = width
                    runs += 1
                for a in range(left.shape[1]):
                    across_0[width + a], across_1[width + a], across_2[width + a] = left[0, a], left[1, a], left[2, a]
                    row_of[width + a] = row + a
                width += left.shape[1]
        begin[runs] = width
        first = 0
        for a in range(width):
            w0, w1, w2 = across_0[a], across_1[a], across_2[a]
            y0 = w0 * inverse[0, 0] + w1 * inverse[1, 0] + w2 * inverse[2, 0]
            y1 = w0 * inverse[0, 1] + w1 * inverse[1, 1] + w2 * inverse[2, 1]
            y2 = w0 * inverse[0, 2] + w1 * inverse[1, 2] + w2 * inverse[2, 2]
            rhs[row_of[a]] -= y0 * b_l[0] + y1 * b_l[1] + y2 * b_l[2]
            first += begin[first + 1] <= a
            for run in range(first, runs):
                left_end, right_end = max(a, begin[run]), begin[run + 1]
                x0, x1, x2 = across_0[left_end:right_end], across_1[left_end:right_end], across_2[left_end:right_end]
                entries = S[row_of[a], row_of[left_end] : row_of[left_end] + right_end - left_end]
                for b in range(len(entries)):
                    entries[b] -= y0 * x0[b] + y1 * x1[b] + y2 * x2[b]
        start = stop
    mirror_upper(S)
    return S, rhs, V_inverse, b_landmark, W_timing, W, cost
