"""Trajectories as KITTI's and EuRoC's text, and pose graphs as g2o's. TUM's is in `odom.evaluation.files`."""

import numpy as np
from scipy.spatial.transform import Rotation

from odom.evaluation.trajectory import Trajectory
from odom.export.scene import Scene
from odom.geometry.arrays import Array

_UPPER = np.triu_indices(6)
"""The upper triangle of an information matrix, row by row, as g2o has it."""
_EUROC = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"


def kitti(trajectory: Trajectory) -> tuple[str, str]:
    """Return poses (the upper 3 x 4 of T_first_camera, twelve numbers a line) and times (s since the first) as text."""
    if not len(trajectory):
        return "", ""
    T = np.linalg.inv(trajectory.T_world_body[0]) @ trajectory.T_world_body
    poses = "".join(" ".join(f"{value:.9e}" for value in one[:3].ravel()) + "\n" for one in T)
    times = "".join(f"{(stamp - trajectory.stamps[0]) * 1e-9:.9f}\n" for stamp in trajectory.stamps)
    return poses, times


def euroc(trajectory: Trajectory) -> str:
    """Return the CSV of EuRoC's ground truth: nanoseconds, position, quaternion with w first."""
    lines = [_EUROC]
    for stamp, T in zip(trajectory.stamps, trajectory.T_world_body, strict=True):
        lines.append(f"{stamp}," + ",".join(f"{value:.9f}" for value in (*T[:3, 3], *_wxyz(T))) + "\n")
    return "".join(lines)


def g2o(scene: Scene) -> str:
    """Return the graph of the key frames and their registrations, loop closures among them, the first key frame fixed.

    An edge's information is the inverse of its covariance over (translation, rotation vector), as gtsam reads it.
    """
    lines = []
    for number, keyframe in enumerate(scene.keyframes):
        lines.append(f"VERTEX_SE3:QUAT {number} {_pose(keyframe.T_map_camera)}\n")
    lines.append("FIX 0\n" if scene.keyframes else "")
    for edge in sorted(scene.edges, key=lambda edge: (edge.a, edge.b)):
        information = np.linalg.inv(edge.covariance)
        upper = " ".join(f"{value:.9g}" for value in (0.5 * (information + information.T))[_UPPER])
        lines.append(f"EDGE_SE3:QUAT {edge.a} {edge.b} {_pose(edge.T_a_b)} {upper}\n")
    return "".join(lines)


def _pose(T: Array) -> str:
    w, x, y, z = _wxyz(T)
    return " ".join(f"{value:.9f}" for value in (*T[:3, 3], x, y, z, w))


def _wxyz(T: Array) -> tuple[float, float, float, float]:
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    return w, x, y, z
