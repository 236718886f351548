"""How a hand-held camera moves: what poses and velocities so far say of the next ones.

A Kalman filter of constant velocity in the tangent space, with white acceleration. It smooths the published poses and
carries them to the image's stamp; where the fits are much better than the motion is predictable, it lets them through
as they are.
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
class Velocity:
    """The camera's `twist` (6, m/s and rad/s, its own frame), with its 6 x 6 `covariance`."""

    twist: Array
    covariance: Array


ANY_VELOCITY = Velocity(np.zeros(6), np.diag(_TWIST_SIGMA**2))
"""That of a hand of which nothing is known yet."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Pose `T_fixed_camera` and `twist` (6, SI, camera frame), with their joint covariance `P` (12 x 12)."""

    T_fixed_camera: Array
    twist: Array
    P: Array

    @classmethod
    def of(cls, T_fixed_camera: Array, covariance: Array, velocity: Velocity = ANY_VELOCITY) -> "Motion":
        """Return the motion of a camera at `T_fixed_camera` (`covariance` 6 x 6) whose velocity errs independently."""
        P = np.zeros((12, 12))
        P[:6, :6], P[6:, 6:] = covariance, velocity.covariance
        return cls(T_fixed_camera, velocity.twist, P)

    @property
    def covariance(self) -> Array:
        """The pose's 6 x 6 covariance (`se3`, camera frame)."""
        return self.P[:6, :6]

    def covariance_of_going(self, dt: float) -> Array:
        """Return the 6 x 6 covariance of how far the camera goes in `dt` seconds."""
        return np.asarray(self.P[6:, 6:] * dt * dt)

    def after(self, dt: float, unsteady: float = 0.0) -> "Motion":
        """Return the motion predicted `dt` seconds later.

        Its acceleration is constant meanwhile; `unsteady` is what its changes add to the variance of the position, in
        units of acceleration^2 dt^4 (1/12: as if it were white).
        """
        F = np.eye(12)
        F[:6, 6:] = dt * np.eye(6)
        G = np.concatenate([0.5 * dt * dt * np.eye(6), dt * np.eye(6)])
        P = F @ self.P @ F.T + (G * _ACCELERATION**2) @ G.T
        P[:6, :6] += np.diag(unsteady * dt**4 * _ACCELERATION**2)
        return Motion(self.T_fixed_camera @ se3.exp(self.twist * dt), self.twist, P)

    def corrected(self, T_fixed_camera: Array, covariance: Array) -> "Motion":
        """Return the motion after the pose has been measured with `covariance` (6 x 6)."""
        away = se3.log(se3.inverse(self.T_fixed_camera) @ T_fixed_camera)
        K = np.linalg.solve(self.P[:6, :6] + covariance, self.P[:6]).T
        step = K @ away
        P = self.P - K @ self.P[:6]
        T = se3.orthonormal(self.T_fixed_camera @ se3.exp(step[:6]))
        return Motion(T, self.twist + step[6:], 0.5 * (P + P.T))
