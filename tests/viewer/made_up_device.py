"""A made-up device: a camera that goes round a room, its images, its estimates and its truth, cheap at any rate."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.backend import Estimate, Features, LoopCandidate, RelativePose, State, TrajectoryPose
from odom.frame import Camera, RgbdFrame, Stamp
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.service.estimate_messages import (
    feature_message,
    keyframe_message,
    landmark_message,
    loop_messages,
    pose_messages,
)
from odom.service.path_topics import PathTopics
from odom.wire import Message, Topics, codec, truth

CAMERA = Camera(640, 480, 520.0, 520.0, 319.5, 239.5)
SMALL_CAMERA = Camera(160, 120, 130.0, 130.0, 79.5, 59.5)
PERIOD_NS = 33_333_333
BEGIN = Stamp(1_700_000_000_000_000_000)
T_WORLD_MAP = se3.exp(np.array([0.3, -0.2, 1.0, 0.0, 0.0, 0.7]))
_ROUND = 600
_PICTURES = 12


@dataclass(frozen=True)
class MadeUp:
    """Options: frames, distance of key frames in frames, and what the marker body adds to the camera's truth.

    From frame `part_from` to `part_until` the camera is in a segment of its own, which is joined then.
    """

    frames: int = 300
    keyframe_every: int = 15
    body: str = "camera"
    T_body_camera: Array | None = None
    clock_offset_s: float = 0.0
    images: bool = True
    camera: Camera = CAMERA
    drift_m: float = 0.0
    part_from: int = 1 << 30
    part_until: int = 1 << 30

    def segment(self, index: int) -> int:
        """Return the segment a frame begins in."""
        return int(self.part_from <= index < self.part_until)

    def stamp(self, index: int) -> Stamp:
        """Return the capture stamp of a frame."""
        return Stamp(BEGIN + index * PERIOD_NS)


def true_pose(index: float) -> Array:
    """Return T_map_camera of a camera that goes round an ellipse while it turns, looking about."""
    a = 2.0 * np.pi * index / _ROUND
    T = se3.exp(np.array([0.0, 0.0, 0.0, 0.25 * np.sin(3 * a), a, 0.2 * np.cos(2 * a)]))
    T[:3, 3] = 1.2 * np.sin(a), 0.15 * np.sin(2 * a), 0.8 * (1 - np.cos(a))
    return T


def estimates(options: MadeUp) -> Iterator[Estimate]:
    """Yield estimates that drift along x, corrected in the path, with loop candidates and a spell of uncertainty."""
    rng = np.random.default_rng(7)
    keyframes: list[TrajectoryPose] = []
    for i in range(options.frames):
        stamp, T_map = options.stamp(i), true_pose(i)
        T_odom = T_map.copy()
        T_odom[0, 3] += options.drift_m * i / _ROUND
        T_map_odom = np.eye(4)
        T_map_odom[0, 3] = -options.drift_m * i / _ROUND
        sigma = 1e-4 * np.sqrt(i + 1)
        is_keyframe = i % options.keyframe_every == 0
        loops: tuple[LoopCandidate, ...] = ()
        if is_keyframe:
            keyframes.append(TrajectoryPose(stamp, T_map, options.segment(i)))
            if i >= options.part_until:
                keyframes = [replace(pose, segment=0) for pose in keyframes]
            if len(keyframes) > 6 and len(keyframes) % 3 == 0:
                accepted = len(keyframes) % 6 == 0
                reason = "the geometry agrees" if accepted else "only 11 inliers"
                loops = (LoopCandidate(stamp, keyframes[len(keyframes) // 3].stamp, 90, accepted, reason),)
        uncertain = 100 <= i % 400 < 110
        uv = rng.uniform((0, 0), (options.camera.width, options.camera.height), (60, 2))
        yield Estimate(
            sequence=i,
            stamp=stamp,
            state=State.UNCERTAIN if uncertain else State.TRACKING,
            reason="few inliers" if uncertain else "",
            segment=options.segment(i),
            T_odom_camera=T_odom,
            covariance=np.diag([sigma**2] * 3 + [(0.3 * sigma) ** 2] * 3),
            T_map_odom=T_map_odom,
            inliers=150,
            matches=200,
            is_keyframe=is_keyframe,
            step=RelativePose(stamp, stamp, np.eye(4), np.eye(6)),
            loops=loops,
            features=Features(uv, np.abs(rng.normal(size=60))),
            path=tuple(keyframes) if is_keyframe else None,
            landmarks_map=rng.uniform(-2, 2, (200, 3)) if is_keyframe else None,
        )


def messages(options: MadeUp, topics: Topics) -> Iterator[tuple[Message, ...]]:
    """Yield what is published for each frame, in order, truth first."""
    paths = PathTopics(topics)
    pictures = _pictures(options.camera) if options.images else ()
    X = options.T_body_camera if options.T_body_camera is not None else np.eye(4)
    for estimate in estimates(options):
        i = estimate.sequence
        out: list[Message] = []
        if i % 30 == 0:
            out.append(codec.encode_camera_info(topics.camera_info, estimate.stamp, options.camera))
        for part in range(4):
            at = i + part / 4
            stamp = Stamp(BEGIN + round((at * PERIOD_NS) + options.clock_offset_s * 1e9))
            T_world = T_WORLD_MAP @ true_pose(at) @ se3.inverse(X)
            out.append(codec.encode_pose(truth(options.body), stamp, T_world, "world"))
        if pictures:
            jpeg, depth_mm = pictures[i % len(pictures)]
            out.append(codec.encode_color_file(topics.color_compressed, estimate.stamp, jpeg))
            out.append(codec.encode_depth(topics.depth, Stamp(estimate.stamp + 3_000_000), depth_mm))
        out += pose_messages(topics, estimate)
        out += loop_messages(topics, estimate.loops)
        features = feature_message(topics, estimate)
        out += [features] if features is not None else []
        out += paths.messages(estimate)
        landmarks = landmark_message(topics, estimate)
        out += [landmarks] if landmarks is not None else []
        if pictures and estimate.is_keyframe:
            color = codec.encode_color_file(topics.color_compressed, estimate.stamp, jpeg)
            frame = RgbdFrame(i, estimate.stamp, depth_mm.astype(np.uint8), estimate.stamp, depth_mm)
            out.append(keyframe_message(topics, frame, options.camera, color, 3000))
        values = {"state": estimate.state.value, "reason": estimate.reason, "inliers": "150", "matches": "200"}
        values |= {"processing_ms": "8.5", "latency_ms": "12.5"}
        out.append(codec.encode_status(topics.status, codec.Status(estimate.stamp, "odometry", 0, "", values)))
        yield tuple(out)


def _pictures(camera: Camera) -> tuple[tuple[bytes, NDArray[np.uint16]], ...]:
    rng = np.random.default_rng(3)
    width, height = camera.width, camera.height
    coarse = rng.integers(30, 226, (60, 80, 3), dtype=np.uint8)
    wide = np.asarray(
        cv2.resize(coarse, (width + 8 * _PICTURES, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8
    )
    pictures = []
    for k in range(_PICTURES):
        image = np.ascontiguousarray(wide[:, 8 * k : 8 * k + width])
        depth = (1200 + 900 * rng.random((12, 16))).astype(np.float32)
        smooth = cv2.resize(depth, (width, height), interpolation=cv2.INTER_CUBIC) + rng.normal(0, 4, (height, width))
        pictures.append((cv2.imencode(".jpg", image)[1].tobytes(), smooth.astype(np.uint16)))
    return tuple(pictures)
