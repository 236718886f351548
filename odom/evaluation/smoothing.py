"""Symmetric smoothing of densely sampled truth, so that its noise does not bias the estimated clock offset.

A. Savitzky and M. Golay, "Smoothing and differentiation of data by simplified least squares procedures", 1964;
rotations are smoothed in the tangent space of the middle sample.
"""

import numpy as np

from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.rotations import matrices_of_vectors, vectors_of

_HALF_WINDOW_S = 0.035
"""Half the window: longer ones flatten a hand's motion, shorter ones leave the noise."""
_LONGEST_SPAN = 1.2
"""A window that lasts longer than this many times its usual length has a hole in it."""


def smooth(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with each pose replaced by a local quadratic's value at its stamp.

    Poses whose window would reach over a hole or past an end, and trajectories sampled too sparsely, stay as they are.
    """
    n = len(trajectory)
    if n < 5:
        return trajectory
    period = float(np.median(np.diff(trajectory.stamps)))
    half = int(_HALF_WINDOW_S * 1e9 / period)
    if half < 2 or n <= 2 * half:
        return trajectory
    from scipy.signal import savgol_coeffs  # takes half a second, which a viewer that starts does not have

    weights = savgol_coeffs(2 * half + 1, 2)
    spans = trajectory.stamps[2 * half :] - trajectory.stamps[: n - 2 * half]
    whole = np.flatnonzero(spans < _LONGEST_SPAN * 2 * half * period) + half
    T = trajectory.T_world_body
    inverse = se3.inverses(T[whole])
    shift, turn = np.zeros((len(whole), 3)), np.zeros((len(whole), 3))
    for weight, lag in zip(weights, range(-half, half + 1), strict=True):
        relative = inverse @ T[whole + lag]
        shift += weight * relative[:, :3, 3]
        turn += weight * vectors_of(relative[:, :3, :3])
    step = np.tile(np.eye(4), (len(whole), 1, 1))
    step[:, :3, :3] = matrices_of_vectors(turn)
    step[:, :3, 3] = shift
    out = T.copy()
    out[whole] = T[whole] @ step
    return Trajectory(trajectory.stamps, out)
