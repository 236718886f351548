"""An estimate as the messages that other processes see. Pure."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from odom.backend import ClosedChain, Estimate, LoopCandidate
from odom.frame import Camera, RgbdFrame, Stamp, corrected_depth
from odom.frontend.matching.moving_surfaces import MovingCells
from odom.geometry import se3
from odom.viewer.keyframe_clouds import back_project
from odom.wire import TF, Message, Topics, codec
from odom.wire.codec import cdr

_COLOR_WIDTH = 160
"""Pixels to which a key frame's image is reduced before it colours a cloud: a quarter of a Kinect's, which JPEG decodes
in a fraction of the time; with 3,000 points more would not be visible."""


def _always(topic: str, type_name: str) -> bool:
    return True


def pose_messages(
    topics: Topics, estimate: Estimate, is_heard: Callable[[str, str], bool] = _always
) -> Iterator[Message]:
    """Yield odom, pose and tf of a frame that has a pose, nothing for a LOST one: no stale pose is repeated.

    Only messages that somebody takes are made: `is_heard` says so by topic and type.
    """
    T_odom_camera, covariance, stamp = estimate.T_odom_camera, estimate.covariance, estimate.stamp
    if T_odom_camera is None:
        return
    if covariance is not None and is_heard(topics.odom, cdr.ODOMETRY):
        yield codec.encode_odometry(
            topics.odom, stamp, T_odom_camera, covariance, topics.frame_odom, topics.frame_camera
        )
    if is_heard(topics.pose, cdr.POSE):
        yield codec.encode_pose(topics.pose, stamp, estimate.T_map_odom @ T_odom_camera, topics.frame_map)
    if is_heard(TF, cdr.TRANSFORMS):
        edges = (
            (topics.frame_map, topics.frame_odom, estimate.T_map_odom),
            (topics.frame_odom, topics.frame_camera, T_odom_camera),
        )
        yield codec.encode_tf(stamp, edges, TF)


def chain_message(topics: Topics, estimate: Estimate, is_heard: Callable[[str, str], bool] = _always) -> Message | None:
    """Return the chain's pose, with the last link as the twist: its motion and covariance by the time it took.

    None for a frame that has none, or where `is_heard` says that nobody takes it.
    """
    chain, link, twist = estimate.chain, estimate.pairwise, None
    if chain is None or not is_heard(topics.chain, cdr.ODOMETRY):
        return None
    if link is not None:
        seconds = (estimate.stamp - link.stamp_earlier) * 1e-9
        twist = codec.Twist(se3.log(link.T_earlier_current) / seconds, link.covariance / seconds**2)
    T, covariance, frames = chain.T_chain_camera, chain.covariance, (topics.frame_odom, topics.frame_camera)
    return codec.encode_odometry(topics.chain, estimate.stamp, T, covariance, *frames, twist)


def closed_chain_message(topics: Topics, closed: ClosedChain) -> Message:
    """Return the closed chain's poses at its nodes."""
    poses = [(Stamp(int(stamp)), T) for stamp, T in zip(closed.stamps, closed.T_closed_camera, strict=True)]
    return codec.encode_path(topics.chain_closed, poses[-1][0], poses, topics.frame_odom)


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


def status_values(estimate: Estimate) -> dict[str, str]:
    """Return what a status says of the newest frame, beside its state."""
    moving = "" if estimate.moving is None else f"{100.0 * estimate.moving.share:.0f}"
    return {
        "segment": str(estimate.segment),
        "inliers": str(estimate.inliers),
        "matches": str(estimate.matches),
        "moving_percent": moving,
    }


def moving_message(topics: Topics, stamp: Stamp, moving: MovingCells) -> Message:
    """Return the squares of the image that move."""
    side_px = np.array(moving.image_shape) / moving.mask.shape
    v, u = ((np.argwhere(moving.mask) + 0.5) * side_px - 0.5).T
    points = np.column_stack([u, v, np.full(len(u), side_px.max())])
    return codec.encode_points(topics.moving, stamp, points, topics.frame_camera, ("u", "v", "side_px"))


def landmark_message(topics: Topics, estimate: Estimate) -> Message | None:
    """Return the landmarks of the map, None when the estimate does not bring them."""
    if estimate.landmarks_map is None:
        return None
    return codec.encode_points(topics.landmarks, estimate.stamp, estimate.landmarks_map, topics.frame_map)


def keyframe_message(
    topics: Topics, frame: RgbdFrame, camera: Camera, color: Message, points: int, moving: MovingCells | None = None
) -> Message:
    """Return the cloud of a key frame, at most about `points`, with the colours of its image message `color`.

    What moves is left out. Raises WireError when the image cannot be decoded.
    """
    depth_mm = frame.depth_mm
    depth_mm = corrected_depth(depth_mm, camera.depth)
    if moving is not None and moving.mask.any():
        depth_mm = np.where(moving.over_image(), np.uint16(0), depth_mm)
    cloud = back_project(camera, codec.decode_color_small(color, _COLOR_WIDTH), depth_mm, points)
    return codec.encode_cloud(topics.keyframes, frame.stamp, cloud.points, cloud.colors, topics.frame_camera)
