"""The camera's velocity from a single image: its rows are read one after the other while the camera moves.

The upper rows show landmarks as seen some milliseconds before the middle one, the lower rows as seen after it. Pose
and velocity are fitted together, starting from the motion expected. The velocity is far less noisy than the difference
of two poses, which also lags behind by half a period. Source of the model: rolling-shutter pose estimation, e.g.
O. Ait-Aider et al., "Simultaneous object pose and velocity computation using a single view", ECCV 2006.
"""

import numpy as np

from odom.backend.tracking.motion_model import Motion, Velocity
from odom.backend.tracking.pose_solver import projected, robust_information
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled


@compiled
def _accumulate(
    T: Array, points: Array, covariances: Array, values: Array, variances: Array, row_s: Array, cauchy: float
) -> tuple[Array, Array]:
    """Return H (12 x 12) and g (12) of pose and velocity: a row `row_s` late has Jacobian [-J, -J row_s]."""
    H = np.zeros((12, 12))
    g = np.zeros(12)
    J = np.zeros((3, 6))
    A = np.zeros((3, 12))
    for k in range(points.shape[0]):
        x, y, w = projected(T, points, k)
        if w == 0.0:
            continue
        _, _, ixx, ixy, iyy, iww = robust_information(T, (x, y, w), covariances, values, variances, k, cauchy)
        rx, ry, rw = values[k, 0] - x, values[k, 1] - y, values[k, 2] - w if iww > 0.0 else 0.0
        interaction_matrix(x, y, w, J)
        for a in range(6):
            A[0, a], A[1, a], A[2, a] = -J[0, a], -J[1, a], -J[2, a]
            A[0, 6 + a], A[1, 6 + a] = -J[0, a] * row_s[k], -J[1, a] * row_s[k]
        for a in range(12):
            j0 = ixx * A[0, a] + ixy * A[1, a]
            j1 = ixy * A[0, a] + iyy * A[1, a]
            j2 = iww * A[2, a]
            g[a] += j0 * rx + j1 * ry + j2 * rw
            for b in range(a, 12):
                H[a, b] += j0 * A[0, b] + j1 * A[1, b] + j2 * A[2, b]
    for a in range(12):
        for b in range(a):
            H[a, b] = H[b, a]
    return H, g


def fit_velocity(
    points_map: Array,
    covariances_map: Array,
    measured: Measurements,
    row_s: Array,
    T_camera_map: Array,
    twist: Array,
    expected: Motion,
    scale: float,
) -> Velocity:
    """Fit pose and velocity of a frame that measured n landmarks; return the velocity.

    `points_map` (n x 3 m) with `covariances_map` (n x 3 x 3 m^2); `measured` was carried to the middle row with
    `twist` (6, SI, camera frame), over `row_s` (n, the rows' times since the middle one); `T_camera_map` is the pose
    fitted to that. `expected` is the motion predicted for this frame, of the camera in the map; `scale` multiplies the
    covariances of measurements. Rows say less than independent errors would (`row_information`): a landmark's error,
    and the lens's, stay from frame to frame.
    """
    scale *= TUNING.row_information
    P = expected.P / scale
    T_expected = se3.inverse(expected.T_fixed_camera)
    H, g = _accumulate(
        T_camera_map, points_map, covariances_map, measured.values, measured.covariance, row_s, TUNING.cauchy_chi2
    )
    away = np.concatenate([-se3.log(T_camera_map @ se3.inverse(T_expected)), twist - expected.twist])
    # inv(H + inv(P)) without inv(P): of frames hardly apart in time, P is singular
    solved = np.linalg.solve(np.eye(12) + P @ H, np.column_stack([P, P @ g - away]))
    covariance = 0.5 * (solved[6:, 6:12] + solved[6:, 6:12].T)
    return Velocity(twist + solved[6:, 12], covariance * scale)
