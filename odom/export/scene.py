"""What there is to export: the final trajectory, key frames with the landmarks they saw, and their registrations."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from odom.backend import TrajectoryPose
from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge
from odom.errors import InputError
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.image_scale import own_uv, scale_of
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class SceneKeyframe:
    """A key frame: its pose at its middle row's time, with the 6 x 6 covariance (`se3`, camera frame) since the start.

    `landmarks` (n) are rows of the scene's points that it saw at `uv` (n x 2 px of its image as taken).
    """

    stamp: Stamp
    T_map_camera: Array
    covariance: Array
    landmarks: Index
    uv: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """The largest part of a trajectory that is joined: poses at the frames' stamps, key frames, `points` (m x 3, map).

    `edges` are the registrations among the key frames, numbered as in `keyframes`; `parts` is how many there are that
    were never joined.
    """

    timing: ShutterTiming
    trajectory: Trajectory
    keyframes: tuple[SceneKeyframe, ...]
    points: Array
    edges: tuple[Edge, ...]
    parts: int = 1

    @property
    def landmarks_seen(self) -> int:
        """How many of the points the key frames saw; the others are of other parts."""
        return len(set().union(*(keyframe.landmarks.tolist() for keyframe in self.keyframes)))

    def pose_at(self, stamp: float) -> Array:
        """Return T_map_camera (4 x 4) at any time (ns), beyond the ends that of the nearest pose."""
        trajectory = self.trajectory
        inside = np.clip(round(stamp), trajectory.stamps[0], trajectory.stamps[-1])
        T, _ = trajectory.at(np.array([inside], dtype=np.int64), np.inf)
        return np.asarray(T[0])

    def pose_of_color(self, stamp: Stamp) -> Array:
        """Return T_map_camera at the time of the middle row of the colour image with this stamp."""
        return self.pose_at(stamp - 1e9 * self.timing.since_middle_s)

    def pose_of_depth(self, depth_stamp: Stamp) -> Array:
        """Return T_map_camera at the time that the middle row of the depth image with this stamp shows."""
        return self.pose_at(depth_stamp + 1e9 * self.timing.depth_lag_s)

    def twist_of_color(self, stamp: Stamp) -> Array:
        """Return the camera's velocity (6: m/s, rad/s, its own frame) while the colour image with this stamp was taken.

        Zero where the trajectory has no poses around it.
        """
        stamps = self.trajectory.stamps
        middle = stamp - 1e9 * self.timing.since_middle_s
        right = int(np.clip(np.searchsorted(stamps, middle), 1, max(len(stamps) - 1, 1)))
        if len(stamps) < 2:
            return np.zeros(6)
        T, T_next = self.trajectory.T_world_body[right - 1 : right + 1]
        return np.asarray(se3.log(se3.inverse(T) @ T_next) / ((stamps[right] - stamps[right - 1]) * 1e-9))


def scene_of(camera: Camera, timing: ShutterTiming, poses: Iterable[TrajectoryPose], map_: Map) -> Scene:
    """Return what a finished odometry holds of the segment with the most poses.

    Raises InputError when it holds no pose.
    """
    found = [pose for pose in poses if pose.T_map_camera is not None]
    if not found:
        raise InputError("no frame has a pose: there is nothing to export")
    sizes = Counter(pose.segment for pose in found)
    ((segment, _),) = sizes.most_common(1)
    trajectory = replace(Trajectory.of(pose for pose in found if pose.segment == segment), segment=None)
    of_other_times = {pose.stamp for pose in found if pose.segment == segment} - set(trajectory.stamps.tolist())
    members = [keyframe for keyframe in map_.members(segment) if keyframe.stamp not in of_other_times]
    place = {keyframe.number: i for i, keyframe in enumerate(members)}
    rows = np.flatnonzero(map_.landmarks.alive)
    rows = rows[~map_.landmarks.is_vague(rows)]
    point_of = np.full(len(map_.landmarks.alive), -1)
    point_of[rows] = np.arange(len(rows))
    keyframes = []
    for keyframe in members:
        is_current = keyframe.current(map_.landmarks) & (point_of[keyframe.rows] >= 0)
        keyframes.append(
            SceneKeyframe(
                keyframe.stamp,
                se3.inverse(keyframe.T_camera_map),
                keyframe.covariance_since_start,
                point_of[keyframe.rows[is_current]],
                own_uv(keyframe.uv[is_current], scale_of(camera)),
            )
        )
    edges = tuple(
        Edge(place[edge.a], place[edge.b], edge.T_a_b, edge.covariance, edge.is_loop)
        for edge in map_.registrations.among(place.keys())
    )
    points = map_.landmarks.position[rows].copy()
    return Scene(timing, trajectory, tuple(keyframes), points, edges, len(sizes))
