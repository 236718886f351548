"""The depth of landmarks for which none was measured: each frame that finds them tells it better, by parallax.

C. Forster, M. Pizzoli, D. Scaramuzza, "SVO: Fast semi-direct monocular visual odometry", ICRA 2014, with a Gaussian
over inverse depth and without its mixture: outliers of the pose are left out already.
"""

import numpy as np

from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.pose_solver import projection_terms
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_STEPS = 3
"""Gauss-Newton steps: a ray is nearly linear in inverse depth."""
_LEAST_INVERSE_DEPTH = 0.01
"""1/m; a landmark farther than 100 m is put there: it has no parallax within a room."""


def refine_depths(map_: Map, seen: MeasuredLandmarks, T_camera_map: Array, covariance: Array, tilt: Array) -> int:
    """Move the landmarks of vague depth that a frame has `seen` along the rays that first showed them.

    The frame's pose has the `covariance` (6 x 6, `se3`, camera frame); its depth has the `tilt` (2, rad). Where it was
    measured in the frame, depth is not assumed any more. Returns how many were vague before.
    """
    L = map_.landmarks
    is_vague, is_measured = L.is_vague(seen.rows), L.assumed.take(seen.rows) & (seen.measurements.values[:, 2] > 0.0)
    chosen = np.flatnonzero(is_vague | is_measured)
    if not len(chosen):
        return 0
    rows, measured = seen.rows[chosen], seen.measurements.take(chosen).straight(tilt)
    T_first_map = np.array([map_.keyframes[k].T_camera_map for k in L.keyframe[rows].tolist()])
    L.position[rows], L.covariance[rows], L.plane[rows, 0] = _refined(
        L.position[rows],
        L.covariance[rows],
        T_first_map,
        T_camera_map,
        covariance,
        measured.values,
        measured.covariance * np.array([TUNING.parallax_variance] * 3 + [1.0]),
    )
    L.assumed[seen.rows[is_measured]] = False
    return int(np.count_nonzero(is_vague))


def warm_up() -> None:
    """Compile what `refine_depths` needs, or load it: where depth is everywhere it is not called."""
    points, pose = np.array([[0.0, 0.0, 1.0]]), np.eye(4)
    _refined(points, np.eye(3)[None], pose[None], pose, np.eye(6), points, np.array([[1.0, 0.0, 1.0, 1.0]]))


@compiled
def _refined(
    position: Array,
    covariance: Array,
    T_first_map: Array,
    T_camera_map: Array,
    covariance_pose: Array,
    values: Array,
    variances: Array,
) -> tuple[Array, Array, Array]:
    """Return position (n x 3), covariance (n x 3 x 3) and inverse depth w (n) in the key frames that first saw them.

    A landmark is at e + d / w, with the eye e of that key frame and its ray d, of unit depth. Of the ray that the frame
    measured and of the inverse depth, where it was measured, each adds h' inv(S) h to the information on w, with
    h = dz/dw and S the measurement's covariance (`variances`, n x 4) plus the pose's, carried through J.
    """
    n = len(position)
    moved, spread, inverse_depth = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty(n)
    r, h, J, JC, P, S = np.zeros(3), np.zeros(3), np.zeros((3, 6)), np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, 3))
    d, point, of_depth = np.zeros(3), np.zeros(3), np.zeros(3)
    for k in range(n):
        p, T, C = position[k], T_first_map[k], covariance[k]
        depth = T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + T[2, 3]
        variance_depth = 0.0
        for a in range(3):
            eye = -(T[0, a] * T[0, 3] + T[1, a] * T[1, 3] + T[2, a] * T[2, 3])
            d[a] = (p[a] - eye) / depth
            of_depth[a] = C[a, 0] * T[2, 0] + C[a, 1] * T[2, 1] + C[a, 2] * T[2, 2]
            variance_depth += T[2, a] * of_depth[a]
        before, prior = 1.0 / depth, depth**4 / variance_depth
        w, information = before, 0.0
        for _ in range(_STEPS):
            for a in range(3):
                point[a] = p[a] + d[a] * (1.0 / w - depth)
            if not projection_terms(T_camera_map, point, values[k], J, P, r):
                break
            for a in range(3):
                h[a] = -(P[a, 0] * d[0] + P[a, 1] * d[1] + P[a, 2] * d[2]) / (w * w)
            _carry(J, covariance_pose, JC, S)
            sxx, sxy, syy = S[0, 0] + variances[k, 0], S[0, 1] + variances[k, 1], S[1, 1] + variances[k, 2]
            determinant = sxx * syy - sxy * sxy
            hx, hy = (syy * h[0] - sxy * h[1]) / determinant, (sxx * h[1] - sxy * h[0]) / determinant
            information, pull = hx * h[0] + hy * h[1], hx * r[0] + hy * r[1]
            if values[k, 2] > 0.0:
                sww = S[2, 2] + variances[k, 3]
                information, pull = information + h[2] * h[2] / sww, pull + h[2] * r[2] / sww
            w = max(w + (pull + prior * (before - w)) / (information + prior), _LEAST_INVERSE_DEPTH)
        # what is known across the ray, given the depth, grows with the distance; along it is what w says
        grown, along = (before / w) ** 2, 1.0 / ((information + prior) * w**4)
        inverse_depth[k] = w
        for a in range(3):
            moved[k, a] = p[a] + d[a] * (1.0 / w - depth)
            for b in range(3):
                across = C[a, b] - of_depth[a] * of_depth[b] / variance_depth
                spread[k, a, b] = across * grown + d[a] * d[b] * along
    return moved, spread, inverse_depth


@compiled
def _carry(J: Array, C: Array, JC: Array, S: Array) -> None:
    """Fill `S` (3 x 3) with J C J', of J (3 x 6) and a covariance C (6 x 6), by way of `JC` (3 x 6)."""
    for a in range(3):
        for i in range(6):
            JC[a, i] = 0.0
            for j in range(6):
                JC[a, i] += J[a, j] * C[j, i]
        for b in range(3):
            S[a, b] = 0.0
            for i in range(6):
                S[a, b] += JC[a, i] * J[b, i]
