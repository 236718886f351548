"""The causal trajectory: what is published of each frame, at once and for good, with covariances of its motions."""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.estimate import RelativePose
from odom.backend.history import covariance_since_start, relative_covariance, relative_pose
from odom.backend.map import Map
from odom.backend.motion import Agility, Course
from odom.backend.placed import Placed, PlacedFrames
from odom.backend.selfcheck import SelfCheck
from odom.frame import Stamp
from odom.registration import se3

Array = NDArray[np.float64]

_RECENT = 64
_SECOND_S, _NEAR_A_SECOND_S = 1.0, 0.075
_BRIDGE_SIGMA = np.array([0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
"""How fast a predicted pose gets worse: m/s and rad/s."""


@dataclass(frozen=True, eq=False)
class Publication:
    """A pose as it goes out: `placed` at the stamp itself, `T_odom_camera`, and the motions since earlier ones.

    `covariance` (6 x 6, `se3`, camera frame) is that of the pose since its segment began. `T_middle_stamp` is how far
    the camera went from its middle row's time to the stamp, with its 6 x 6 covariance.
    """

    placed: Placed
    T_odom_camera: Array
    covariance: Array | None
    T_middle_stamp: Array = field(default_factory=lambda: np.eye(4))
    covariance_middle_stamp: Array = field(default_factory=lambda: np.zeros((6, 6)))
    step: RelativePose | None = None
    second: RelativePose | None = None


class CausalTrajectory:
    """The frames' places (`frames`, for the middle row) and the newest publications.

    The `map_` grows and moves meanwhile: `T_map_odom` carries the corrections, so that what is published is continuous.
    It is none the surer by them: from the last publication before the newest correction its covariance only grows.
    """

    def __init__(self, map_: Map) -> None:
        self.frames = PlacedFrames()
        self.T_map_odom = np.eye(4)
        self._map = map_
        self._recent: deque[Publication] = deque(maxlen=_RECENT)
        self._newest: Publication | None = None
        self._corrected: Publication | None = None
        self._agility = Agility()
        self._course: Course | None = None

    @property
    def is_lost(self) -> bool:
        """Whether the last frame has no pose, or there is none yet."""
        last = self.frames.last
        return last is None or last.keyframe is None

    def since_last_s(self, stamp: Stamp) -> float:
        """Return the seconds from the last frame to `stamp`, infinite where there is none."""
        last = self.frames.last
        return np.inf if last is None else (stamp - last.stamp) * 1e-9

    def correct(self, T_new_old: Array) -> None:
        """Go on where odom was: a closure has moved the map around the camera by `T_new_old`."""
        self.T_map_odom = T_new_old @ self.T_map_odom
        self._corrected = self._newest

    def begin(self, stamp: Stamp, segment: int, keyframe: int, check: SelfCheck) -> Publication:
        """Publish the first pose of a segment, which its key frame's is by definition."""
        placed = Placed(stamp, segment, 0.0, keyframe, np.eye(4), np.zeros((6, 6)))
        self.frames.append(placed)
        self._course = None
        self._recent.clear()
        T_odom_camera = se3.inverse(self.T_map_odom) @ se3.inverse(self._map.keyframes[keyframe].T_camera_map)
        return self._published(Publication(placed, T_odom_camera, self._since_start(placed, T_odom_camera, check)))

    def advance(
        self,
        middle: Placed,
        T_map_middle: Array,
        covariance: Array,
        twist_dt: float,
        inliers: int,
        check: SelfCheck,
        stamp_sigma_s: float,
    ) -> Publication:
        """Publish a tracked frame, found at `T_map_middle` with `covariance` (6 x 6) in its middle row's time.

        The pose is smoothed and carried to the stamp; to the motion filter's covariance comes how far the camera goes
        in `stamp_sigma_s`, by which the image's time is not known. `twist_dt` is the time since the frame before, 0
        where the motion to it is not known.
        """
        assert middle.T_keyframe_camera is not None
        self.frames.append(middle)
        T_odom_middle = se3.inverse(self.T_map_odom) @ T_map_middle
        if twist_dt and self._course is not None:
            self._course = self._course.tracked(T_odom_middle, covariance, twist_dt)
        else:
            self._course = Course.begun(T_odom_middle, covariance, self._agility)
        self._agility = self._course.agility
        motion = self._course.motion
        carried = motion.after(middle.delay_s, self._agility)
        placed = replace(
            middle,
            T_keyframe_camera=middle.T_keyframe_camera @ se3.inverse(T_odom_middle) @ carried.T_fixed_camera,
            covariance=carried.covariance + np.outer(motion.twist, motion.twist) * stamp_sigma_s**2,
            delay_s=0.0,
        )
        T_middle_stamp = se3.inverse(motion.T_fixed_camera) @ carried.T_fixed_camera
        going = motion.covariance_of_going(middle.delay_s)
        since_start = self._since_start(placed, carried.T_fixed_camera, check)
        current = Publication(placed, carried.T_fixed_camera, since_start, T_middle_stamp, going)
        if self._recent and twist_dt:
            current = replace(current, step=self._motion_since(self._recent[-1], current, inliers, check))
        around = [p for p in self._recent if self._from_a_second(p, placed.stamp) < _NEAR_A_SECOND_S]
        if around:
            then = min(around, key=lambda p: self._from_a_second(p, placed.stamp))
            current = replace(current, second=self._motion_since(then, current, inliers, check))
        return self._published(current)

    @staticmethod
    def _from_a_second(earlier: Publication, stamp: Stamp) -> float:
        return abs((stamp - earlier.placed.stamp) * 1e-9 - _SECOND_S)

    def _motion_since(
        self, earlier: Publication, current: Publication, inliers: int, check: SelfCheck
    ) -> RelativePose | None:
        covariance = relative_covariance(self._map, earlier.placed, current.placed, check.calibration_error)
        stamp = earlier.placed.stamp
        return relative_pose(earlier.T_odom_camera, current.T_odom_camera, covariance, stamp, inliers)

    def bridge(self, stamp: Stamp, twist: Array, check: SelfCheck) -> Publication:
        """Publish what the motion `twist` (6, SI) predicts for a frame that could not be tracked."""
        last = self._recent[-1]
        assert last.placed.T_keyframe_camera is not None
        assert last.placed.covariance is not None
        dt = (stamp - last.placed.stamp) * 1e-9
        step = se3.exp(twist * dt)
        placed = replace(
            last.placed,
            stamp=stamp,
            T_keyframe_camera=last.placed.T_keyframe_camera @ step,
            covariance=last.placed.covariance + np.diag((_BRIDGE_SIGMA * dt) ** 2),
        )
        self.frames.append(placed)
        T_odom_camera = last.T_odom_camera @ step
        return self._published(Publication(placed, T_odom_camera, self._since_start(placed, T_odom_camera, check)))

    def lose(self, stamp: Stamp, segment: int) -> None:
        """Note a frame without a pose; motions are not counted over it."""
        self.frames.append(Placed(stamp, segment, 0.0))
        self._recent.clear()
        self._course = None

    def _published(self, current: Publication) -> Publication:
        self._recent.append(current)
        self._newest = current
        return current

    def _since_start(self, placed: Placed, T_odom_camera: Array, check: SelfCheck) -> Array | None:
        """Return the 6 x 6 covariance of a pose in odom since its segment began."""
        since = self._corrected
        if since is not None and since.covariance is not None:
            moved = relative_covariance(self._map, since.placed, placed, check.calibration_error)
            if moved is not None:
                T_since_camera = se3.inverse(since.T_odom_camera) @ T_odom_camera
                return se3.compose_covariance(since.covariance, T_since_camera, moved)
        return covariance_since_start(self._map.keyframes, placed, check.calibration_error)
