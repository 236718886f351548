"""Where odom lies in the map. It moves with what becomes known of the map, so that poses in odom are continuous.

It begins where the camera was when the first image was stamped. The map knows where that camera was at the middle row's
time: the way from there to the stamp follows from its velocity, which the second frame shows, and from the timing of
the shutter, which becomes known better as the camera moves.
"""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.pose_covariance import delay_covariance
from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.motion_model import Velocity
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array

_TINY = 1e-12
"""Keeps a division by the size of no motion finite (m, rad)."""


@dataclass(frozen=True, eq=False)
class Origin:
    """The first frame of a `segment`, published at `T_odom_camera`, whose stamp came `late_s` seconds late.

    The camera moved with `velocity`, None before that is known, for the `delay_s` from the middle row's time to the
    stamp.
    """

    segment: int
    T_odom_camera: Array
    late_s: float
    velocity: Velocity | None = None
    delay_s: float = 0.0

    def with_velocity(self, velocity: Velocity, timing: ShutterTiming) -> "Origin":
        """Return the same of a camera whose `velocity` is known, and of a shutter of that `timing`."""
        return replace(self, velocity=velocity, delay_s=self.late_s + timing.since_middle_s)

    @property
    def T_middle_stamp(self) -> Array:
        """The motion from the middle row's time to the stamp, as far as it is known."""
        return np.eye(4) if self.velocity is None else se3.exp(self.delay_s * self.velocity.twist)

    def shift_to(self, other: "Origin") -> Array:
        """Return T_odom_new: odom as `other` puts the origin, in odom as this one does."""
        way = se3.inverse(self.T_middle_stamp) @ other.T_middle_stamp
        return np.asarray(self.T_odom_camera @ way @ se3.inverse(self.T_odom_camera))

    def covariance_to(self, T_odom_camera: Array, twist: Array, delay_variance: float) -> Array:
        """Return what the origin adds to the 6 x 6 covariance of a later pose of a camera that moves with `twist`.

        `delay_variance` (s^2) is that of the delay, which errs alike in both.
        """
        if self.velocity is None:
            return np.zeros((6, 6))
        A = se3.adjoint(se3.inverse(T_odom_camera) @ self.T_odom_camera)
        of_velocity = self.delay_s * self.delay_s * (A @ self.velocity.covariance @ A.T)
        return np.asarray(of_velocity + delay_covariance(A, self.velocity.twist, twist, delay_variance))


class OdomInMap:
    """`T_map_odom`, and the `origin` of the segment that began last, None where that is not known."""

    def __init__(self) -> None:
        self.T_map_odom = np.eye(4)
        self.origin: Origin | None = None
        self._T_map_odom_wanted: Array | None = None

    def correct(self, T_new_old: Array) -> None:
        """Keep odom continuous: a closure has moved the map around the camera by `T_new_old`."""
        self.T_map_odom = T_new_old @ self.T_map_odom
        if self._T_map_odom_wanted is not None:
            self._T_map_odom_wanted = T_new_old @ self._T_map_odom_wanted

    def change_lens(self, T_new_old: Array) -> None:
        """Keep odom continuous where a better lens has moved the map around the camera by `T_new_old`.

        What the poor lens had displaced is undone little by little as the camera moves (see `next_pose`).
        """
        wanted = self.T_map_odom if self._T_map_odom_wanted is None else self._T_map_odom_wanted
        self.correct(T_new_old)
        self._T_map_odom_wanted = wanted

    def move_origin(self, origin: Origin) -> Array:
        """Put the origin where it is known to be now; return T_new_old, by which poses in odom change."""
        assert self.origin is not None
        T_old_new = self.origin.shift_to(origin)
        self.T_map_odom, self.origin = self.T_map_odom @ T_old_new, origin
        if self._T_map_odom_wanted is not None:
            self._T_map_odom_wanted = self._T_map_odom_wanted @ T_old_new
        return se3.inverse(T_old_new)

    def pose(self, T_map_camera: Array) -> Array:
        """Return T_odom_camera of a pose in the map."""
        return np.asarray(se3.inverse(self.T_map_odom) @ T_map_camera)

    def next_pose(self, T_map_camera: Array, T_odom_last: Array | None) -> Array:
        """Return T_odom_camera of the newest pose in the map, a step nearer to where the better lens would have had it.

        The step is a small share of the motion since the last pose: a calibration errs by as much anyway. Metres and
        radians count alike: at a depth of a metre, both move a feature about as far.
        """
        T_odom_camera, wanted = self.pose(T_map_camera), self._T_map_odom_wanted
        if wanted is None or T_odom_last is None:
            return T_odom_camera
        left = se3.log(se3.inverse(T_odom_camera) @ se3.inverse(wanted) @ T_map_camera)
        moved = TUNING.taken_back * _size(se3.log(se3.inverse(T_odom_last) @ T_odom_camera))
        if moved >= _size(left):
            self._T_map_odom_wanted, moved = None, _size(left)
        T_odom_camera = se3.orthonormal(T_odom_camera @ se3.exp(moved / max(_size(left), _TINY) * left))
        self.T_map_odom = T_map_camera @ se3.inverse(T_odom_camera)
        return T_odom_camera


def _size(motion: Array) -> float:
    return float(np.linalg.norm(motion[:3]) + np.linalg.norm(motion[3:]))
