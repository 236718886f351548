"""An estimate as the messages that other processes see. Pure."""

from collections.abc import Iterable, Iterator

import numpy as np

from odom.backend import Estimate, LoopCandidate
from odom.wire import Message, Topics, codec


def pose_messages(topics: Topics, estimate: Estimate) -> Iterator[Message]:
    """Yield odom, pose and tf of a frame that has a pose, nothing for a LOST one: no stale pose is ever repeated."""
    T_odom_camera, covariance, stamp = estimate.T_odom_camera, estimate.covariance, estimate.stamp
    if T_odom_camera is None:
        return
    if covariance is not None:
        yield codec.encode_odometry(
            topics.odom, stamp, T_odom_camera, covariance, topics.frame_odom, topics.frame_camera
        )
    yield codec.encode_pose(topics.pose, stamp, estimate.T_map_odom @ T_odom_camera, topics.frame_map)
    yield codec.encode_tf(
        stamp,
        (
            (topics.frame_map, topics.frame_odom, estimate.T_map_odom),
            (topics.frame_odom, topics.frame_camera, T_odom_camera),
        ),
    )


def loop_messages(topics: Topics, loops: Iterable[LoopCandidate]) -> Iterator[Message]:
    """Yield one message a loop candidate."""
    for loop in loops:
        values = codec.Loop(loop.stamp, loop.candidate_stamp, loop.inliers, loop.accepted, loop.reason)
        yield codec.encode_loop(topics.loops, values)


def feature_message(topics: Topics, estimate: Estimate) -> Message | None:
    """Return the tracked features (u, v, residual_sigma), None when the estimate shows none."""
    if estimate.features is None:
        return None
    points = np.column_stack([estimate.features.uv, estimate.features.residual_sigma])
    fields = ("u", "v", "residual_sigma")
    return codec.encode_points(topics.features, estimate.stamp, points, topics.frame_camera, fields)


def map_messages(topics: Topics, estimate: Estimate) -> Iterator[Message]:
    """Yield the corrected key-frame path and the landmarks, when the estimate brings them."""
    if estimate.path is not None:
        yield codec.encode_path(topics.path, estimate.stamp, estimate.path, topics.frame_map)
    if estimate.landmarks_map is not None:
        yield codec.encode_points(topics.landmarks, estimate.stamp, estimate.landmarks_map, topics.frame_map)
