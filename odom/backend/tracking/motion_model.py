"""How a hand-held camera moves: a Kalman filter of constant velocity in the tangent space.

Its process noise is the acceleration of about the last second (`ProcessNoise`). It smooths the published poses and
carries them to the image's stamp; where the fits are much better than the motion is predictable, it passes them on as
they are.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.tracking.tuning import TUNING
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

AT_REST: Array = np.zeros(6)
"""The twist (6, SI) of a camera that does not move."""
_TWIST_SIGMA = np.repeat([TUNING.velocity_sigma_m_s, TUNING.velocity_sigma_rad_s], 3)
"""One sigma of the velocity (6, m/s and rad/s) of a camera of which nothing is known yet."""


def is_plausible_motion(twist: Array) -> bool:
    """Return whether something carried by a person, or driving, can move with `twist` (6, m/s and rad/s)."""
    vx, vy, vz, wx, wy, wz = twist.tolist()
    speed_m_s, speed_rad_s = math.sqrt(vx * vx + vy * vy + vz * vz), math.sqrt(wx * wx + wy * wy + wz * wz)
    return speed_m_s < TUNING.fastest_m_s and speed_rad_s < TUNING.fastest_rad_s


def mean_twist(T_map_before: Array, T_camera_map: Array, since_s: float) -> Array:
    """Return the mean velocity (6, SI, camera frame) of a camera that went on for `since_s` seconds.

    It was at `T_map_before`, a T_map_camera, and is at `T_camera_map` now.
    """
    return np.asarray(-se3.log(T_camera_map @ T_map_before) / since_s)


@dataclass(frozen=True, eq=False)
class Velocity:
    """The camera's `twist` (6, m/s and rad/s, its own frame), with its 6 x 6 `covariance`."""

    twist: Array
    covariance: Array


ANY_VELOCITY = Velocity(np.zeros(6), np.diag(_TWIST_SIGMA**2))
"""The velocity of a camera of which nothing is known yet."""


@dataclass(frozen=True)
class ProcessNoise:
    """How much a camera accelerates: root mean squares, `linear` (m/s^2) and `angular` (rad/s^2), of each axis.

    An acceleration lasts for some `steady_s` (R. Singer, "Estimating optimal tracking filter performance for manned
    maneuvering targets", 1970); 0: the acceleration is white noise.
    """

    linear: float = TUNING.acceleration_linear
    angular: float = TUNING.acceleration_angular
    steady_s: float = TUNING.acceleration_steady_s

    def carried(self, P: Array, dt: float) -> Array:
        """Return the covariance P (12 x 12) of pose and twist `dt` seconds later: unknown acceleration adds to it."""
        unsteady = dt**2 / (dt**2 + self.steady_s**2) / 12.0 if dt else 0.0
        factors = (0.25 + unsteady) * dt**4, 0.5 * dt**3, dt**2
        return _carried(P, dt, factors, (self.linear**2, self.angular**2))

    def in_steps_of(self, dt: float) -> "ProcessNoise":
        """Return the process noise by which steps of `dt` seconds add up to as much as longer ones.

        `carried` takes the accelerations of different steps to be independent; through several short ones one lasts.
        """
        lasting = math.sqrt(max(1.0, TUNING.acceleration_least_s / dt))
        return self if lasting == 1.0 else ProcessNoise(lasting * self.linear, lasting * self.angular, self.steady_s)

    def after(self, acceleration: Array, dt: float) -> "ProcessNoise":
        """Return the process noise after `acceleration` (6, SI) was seen for `dt` seconds."""
        ax, ay, az, bx, by, bz = acceleration.tolist()
        new = min(1.0, dt / TUNING.acceleration_memory_s)
        old_linear, old_angular = self.linear * self.linear, self.angular * self.angular
        linear = math.sqrt(old_linear + new * ((ax * ax + ay * ay + az * az) / 3.0 - old_linear))
        angular = math.sqrt(old_angular + new * ((bx * bx + by * by + bz * bz) / 3.0 - old_angular))
        linear, angular = max(linear, TUNING.acceleration_least_linear), max(angular, TUNING.acceleration_least_angular)
        return ProcessNoise(linear, angular, self.steady_s)


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

    def after(self, dt: float, process_noise: ProcessNoise) -> "Motion":
        """Return the motion predicted `dt` seconds later, of a camera whose acceleration is that `process_noise`."""
        return Motion(self.T_fixed_camera @ se3.exp(self.twist * dt), self.twist, process_noise.carried(self.P, dt))

    def corrected(self, T_fixed_camera: Array, covariance: Array) -> "Motion":
        """Return the motion after the pose has been measured with `covariance` (6 x 6)."""
        innovation = se3.log(se3.inverse(self.T_fixed_camera) @ T_fixed_camera)
        K = np.linalg.solve(self.P[:6, :6] + covariance, self.P[:6]).T
        step = K @ innovation
        P = self.P - K @ self.P[:6]
        T = se3.orthonormal(self.T_fixed_camera @ se3.exp(step[:6]))
        return Motion(T, self.twist + step[6:], 0.5 * (P + P.T))


@dataclass(frozen=True, eq=False)
class MotionFilter:
    """The filtered `motion` of a tracked camera, and its `process_noise`.

    `T_fitted` is the pose as measured `since_s` seconds ago, where the next acceleration is seen from, and `twist` the
    mean velocity (6, SI) over the `dt` seconds before that, None where it is not known.
    """

    motion: Motion
    process_noise: ProcessNoise
    T_fitted: Array
    twist: Array | None = None
    dt: float = 0.0
    since_s: float = 0.0

    @classmethod
    def begun(cls, T_fixed_camera: Array, covariance: Array, process_noise: ProcessNoise) -> "MotionFilter":
        """Return the filter of a camera of which only the pose is known, with its 6 x 6 covariance."""
        return cls(Motion.of(T_fixed_camera, covariance), process_noise, T_fixed_camera)

    def surprise(self, T_fixed_camera: Array, covariance: Array, dt: float) -> float:
        """Return the squared Mahalanobis distance of a pose, measured with `covariance`, from that predicted for it."""
        predicted = self.motion.after(dt, self.process_noise.in_steps_of(dt))
        innovation = se3.log(se3.inverse(predicted.T_fixed_camera) @ T_fixed_camera)
        return float(innovation @ np.linalg.solve(predicted.covariance + covariance, innovation))

    def updated(self, T_fixed_camera: Array, covariance: Array, dt: float) -> "MotionFilter":
        """Return the filter after the pose was measured `dt` seconds later, with `covariance` (6 x 6)."""
        process_noise, since_s = self.process_noise, self.since_s + dt
        if since_s < TUNING.acceleration_least_s:
            motion = self.motion.after(dt, process_noise.in_steps_of(dt)).corrected(T_fixed_camera, covariance)
            return replace(self, motion=motion, since_s=since_s)
        twist = se3.log(se3.inverse(self.T_fitted) @ T_fixed_camera) / since_s
        if self.twist is not None:
            process_noise = process_noise.after((twist - self.twist) / (0.5 * (since_s + self.dt)), since_s)
        motion = self.motion.after(dt, process_noise.in_steps_of(dt)).corrected(T_fixed_camera, covariance)
        return MotionFilter(motion, process_noise, T_fixed_camera, twist, since_s)

    def moved(self, T_new_old: Array) -> "MotionFilter":
        """Return the filter of the same camera in a frame that was moved by `T_new_old`."""
        motion = replace(self.motion, T_fixed_camera=T_new_old @ self.motion.T_fixed_camera)
        return replace(self, motion=motion, T_fitted=T_new_old @ self.T_fitted)


@compiled
def _carried(P: Array, dt: float, factors: tuple[float, float, float], variances: tuple[float, float]) -> Array:
    """Return `F P F' + Q` (12 x 12) with F = [I, dt I; 0, I].

    Q is what acceleration of the given `variances` (of translation, of rotation) adds on each axis: `factors` times the
    variance to that of the pose, to the covariance of pose and twist, and to the variance of the twist.
    """
    out = P.copy()
    for i in range(12):
        for j in range(6):
            out[i, j] += dt * P[i, 6 + j]
    for i in range(6):
        for j in range(12):
            out[i, j] += dt * out[6 + i, j]
    for i in range(6):
        variance = variances[i // 3]
        out[i, i] += factors[0] * variance
        out[i, 6 + i] += factors[1] * variance
        out[6 + i, i] += factors[1] * variance
        out[6 + i, 6 + i] += factors[2] * variance
    return out
