"""The published pose: single fits smoothed by how a hand-held camera can move, and carried to the image's stamp.

A Kalman filter of constant velocity in the tangent space, with white acceleration; where the fits are much better than
the motion is predictable, it lets them through as they are.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.registration import se3

Array = NDArray[np.float64]

_ACCELERATION = np.array([1.0, 1.0, 1.0, 6.0, 6.0, 6.0])
"""One sigma of a hand-held camera's acceleration: m/s^2 and rad/s^2."""
_TWIST_SIGMA = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


@dataclass(frozen=True, eq=False)
class Motion:
    """Pose `T_odom_camera` and `twist` (6, SI, camera frame), with their joint covariance `P` (12 x 12)."""

    T_odom_camera: Array
    twist: Array
    P: Array

    @classmethod
    def at_rest(cls, T_odom_camera: Array, covariance: Array) -> "Motion":
        """Return the motion of a camera first seen at `T_odom_camera`, of which nothing else is known."""
        P = np.diag(np.concatenate([np.zeros(6), _TWIST_SIGMA**2]))
        P[:6, :6] = covariance
        return cls(T_odom_camera, np.zeros(6), P)

    @property
    def covariance(self) -> Array:
        """The pose's 6 x 6 covariance (`se3`, camera frame)."""
        return self.P[:6, :6]

    def covariance_of_going(self, dt: float) -> Array:
        """Return the 6 x 6 covariance of how far the camera goes in `dt` seconds."""
        return np.asarray(self.P[6:, 6:] * dt * dt)

    def after(self, dt: float) -> "Motion":
        """Return the motion predicted `dt` seconds later."""
        F = np.eye(12)
        F[:6, 6:] = dt * np.eye(6)
        G = np.concatenate([0.5 * dt * dt * np.eye(6), dt * np.eye(6)])
        P = F @ self.P @ F.T + (G * _ACCELERATION**2) @ G.T
        return Motion(self.T_odom_camera @ se3.exp(self.twist * dt), self.twist, P)

    def corrected(self, T_odom_camera: Array, covariance: Array) -> "Motion":
        """Return the motion after the pose has been measured with `covariance` (6 x 6)."""
        away = se3.log(se3.inverse(self.T_odom_camera) @ T_odom_camera)
        K = np.linalg.solve(self.P[:6, :6] + covariance, self.P[:6]).T
        step = K @ away
        P = self.P - K @ self.P[:6]
        T = se3.orthonormal(self.T_odom_camera @ se3.exp(step[:6]))
        return Motion(T, self.twist + step[6:], 0.5 * (P + P.T))
