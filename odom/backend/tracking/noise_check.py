"""What a tracked frame shows of the sensor's noise: its residuals, and how far the image's two halves disagree."""

import numpy as np

from odom.backend.map.map import Map
from odom.backend.tracking.pose_solver import fit_pose
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.noise_monitor import NoiseMonitor
from odom.geometry import se3
from odom.geometry.arrays import Array


def noise_after(
    noise: NoiseMonitor, map_: Map, tracked: TrackedFrame, step: Array | None, frame: int, width: int
) -> NoiseMonitor:
    """Return `noise` after one more tracked frame, number `frame`, whose image is `width` pixels wide.

    `step` (6, `se3`) led to it in one period of the stream, None where it took another time. At the start all frames
    are looked at, then one in a few.
    """
    noise = noise.with_step(step, tracked.information)
    if noise.residuals_seen >= TUNING.noise_checked_all and frame % TUNING.noise_check_every != 0:
        return noise
    nees = nees_of_halves(map_, tracked, width)
    chosen = tracked.inliers & (tracked.chi2[:, 1] < TUNING.inlier_chi2)
    noise = noise.with_residuals(tracked.chi2[chosen], tracked.measurements.values[chosen, 2])
    return noise if nees is None else noise.with_halves(nees)


def nees_of_halves(map_: Map, tracked: TrackedFrame, width: int) -> float | None:
    """Return the NEES (6 expected) of the difference between the poses that the image's left and right half give.

    None where one of the halves holds too few landmarks.
    """
    L = map_.landmarks
    fits = []
    is_left = tracked.uv[:, 0] < width / 2
    for half in (is_left, ~is_left):
        chosen = tracked.inliers & half
        if np.count_nonzero(chosen) < TUNING.noise_half_landmarks:
            return None
        rows = tracked.rows[chosen]
        m = tracked.measurements.take(chosen)
        fits.append(fit_pose(L.position[rows], L.covariance[rows], m.values, m.covariance, tracked.T_camera_map))
    away = se3.log(fits[0].T_camera_map @ se3.inverse(fits[1].T_camera_map))
    S = np.linalg.inv(fits[0].information) + np.linalg.inv(fits[1].information)
    return float(away @ np.linalg.solve(S, away))
