"""A survey of the painted room as the odometry would have made it, with exact poses: what the writers are given."""

import numpy as np
from painted_room import PERIOD, SMALL, START, PaintedRoom, stroll

from odom.backend.map.pose_graph import Edge
from odom.evaluation.trajectory import Trajectory
from odom.export.scene import Scene, SceneKeyframe
from odom.export.views import Survey
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

ROOM = PaintedRoom()
FRAMES, EVERY = 61, 10


def landmarks_of_walls(count=1500):
    """Points spread over the walls of the room."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-1, 1, (count, 3)) * ROOM.half_size
    axis, side = rng.integers(0, 3, count), rng.choice([-1, 1], count)
    points[np.arange(count), axis] = side * np.array(ROOM.half_size)[axis]
    return points


def seen(points, T_map_camera, camera=SMALL):
    """Rows and pixels of the points in a camera's image."""
    there = se3.apply(se3.inverse(T_map_camera), points)
    with np.errstate(all="ignore"):
        uv = there[:, :2] / there[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    inside = (there[:, 2] > 0.1) & (uv > 2).all(axis=1) & (uv < [camera.width - 3, camera.height - 3]).all(axis=1)
    return np.flatnonzero(inside), uv[inside]


def exact_survey():
    """A calm walk through the room: every tenth frame is a key frame."""
    stamps = np.array([START + k * PERIOD for k in range(FRAMES)], dtype=np.int64)
    T = np.array([stroll(k / 30) for k in range(FRAMES)])
    points = landmarks_of_walls()
    keyframes, edges = [], []
    for number, k in enumerate(range(0, FRAMES, EVERY)):
        rows, uv = seen(points, T[k])
        keyframes.append(SceneKeyframe(int(stamps[k]), T[k], 1e-6 * (number + 1) * np.eye(6), rows, uv))
        if number:
            T_a_b = se3.inverse(T[k - EVERY]) @ T[k]
            edges.append(Edge(number - 1, number, T_a_b, np.diag([1e-4, 2e-4, 3e-4, 1e-5, 2e-5, 3e-5])))
    scene = Scene(ShutterTiming(), Trajectory(stamps, T), tuple(keyframes), points, tuple(edges))
    return Survey(SMALL, scene, tuple(stamps.tolist()), (1.0,) * FRAMES)


class RoomRecording:
    """The frames of that walk, as a recording gives them."""

    camera = SMALL

    def __init__(self, only=()):
        self.only = only or range(0, FRAMES, EVERY)

    def __iter__(self):
        for k in self.only:
            yield ROOM.frame(SMALL, k, stroll(k / 30))
