"""A source run through the odometry inside one process, without a wire: for benches."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from odom.backend import Estimate, Odometry, OdometrySettings
from odom.errors import RecordingError
from odom.evaluation.robustness.spoiler import UNSPOILT, Spoiler, Stream
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame
from odom.geometry.arrays import Array
from odom.wire import Message, Topics, truth_body
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_pose
from sensors.source import Source


@dataclass(frozen=True, eq=False)
class Replayed:
    """What a run gave: the estimates without what is for display, the final trajectory, and the truth of each body.

    The body that was seen first comes first: it is the one that `odom run` judges by.
    """

    estimates: list[Estimate]
    trajectory: Trajectory
    truth: dict[str, Trajectory]


def replay(source: Source, topics: Topics, settings: OdometrySettings, spoiler: Spoiler = UNSPOILT) -> Replayed:
    """Run the odometry over a source, spoilt on the way, and close it.

    Raises RecordingError when it holds no frame with a calibration.
    """
    odometry: Odometry | None = None
    estimates: list[Estimate] = []
    truth: dict[str, dict[int, Array]] = {}

    def noting(messages: Iterable[Message]) -> Iterator[Message]:
        for message in messages:
            if body := truth_body(message.topic):
                pose = decode_pose(message)
                truth.setdefault(body, {})[pose.stamp] = pose.T_parent_child
            yield message

    try:
        for camera, frame in frames_of(noting(source.messages()), topics, spoiler):
            odometry = odometry or Odometry(spoiler.camera(camera), settings)
            shown = odometry.process(frame)
            estimates.append(replace(shown, features=None, path=None, landmarks_map=None, loops=()))
    finally:
        source.close()
    if odometry is None:
        raise RecordingError("no frame with a calibration")
    bodies = {
        body: Trajectory(np.array(sorted(poses), dtype=np.int64), np.array([poses[stamp] for stamp in sorted(poses)]))
        for body, poses in truth.items()
    }
    return Replayed(estimates, Trajectory.of(odometry.finish()), bodies)


def frames_of(
    messages: Iterable[Message], topics: Topics, spoiler: Spoiler = UNSPOILT
) -> Iterator[tuple[Camera, RgbdFrame]]:
    """Yield the calibration as recorded and each frame (grey), spoilt; frames before a calibration are left out."""
    assembler = FrameAssembler(topics, grey=True)
    streams = {topics.color: Stream.COLOR, topics.color_compressed: Stream.COLOR}
    streams |= {topics.depth: Stream.DEPTH, topics.depth_compressed: Stream.DEPTH}

    def spoilt(frames: Iterable[RgbdFrame]) -> Iterator[tuple[Camera, RgbdFrame]]:
        for frame in frames:
            if assembler.camera is not None and (kept := spoiler.frame(frame)) is not None:
                yield assembler.camera, kept

    for message in messages:
        stream = streams.get(message.topic)
        seen = replace(message, stamp=spoiler.stamp(stream, message.stamp)) if stream else message
        yield from spoilt(assembler.feed(seen))
    yield from spoilt(assembler.finish())
