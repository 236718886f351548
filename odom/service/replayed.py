"""A source run through the odometry inside one process, without a wire: for benches."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from odom.backend import Estimate, Odometry, OdometrySettings
from odom.errors import RecordingError
from odom.evaluation.robustness.spoiler import UNSPOILT, Spoiler, Stream
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry.arrays import Array
from odom.wire import Message, Topics, truth_body
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_pose
from sensors.source import Source

TruePoses = dict[str, dict[Stamp, Array]]
"""Poses T_world_body (4 x 4) of motion capture, by body and stamp."""


@dataclass(frozen=True, eq=False)
class Replayed:
    """What a run gave: the estimates without what is for display, the final trajectory, and the truth of each body.

    The body that was seen first comes first: it is the one that `odom run` judges by. `timing` is the shutter's.
    """

    estimates: list[Estimate]
    trajectory: Trajectory
    truth: dict[str, Trajectory]
    timing: ShutterTiming


def replay(source: Source, topics: Topics, settings: OdometrySettings, spoiler: Spoiler = UNSPOILT) -> Replayed:
    """Run the odometry over a source, spoilt on the way, and close it.

    Raises RecordingError when it holds no frame with a calibration.
    """
    odometry: Odometry | None = None
    estimates: list[Estimate] = []
    truth: TruePoses = {}
    try:
        for camera, frame in frames_of(noting_truth(source.messages(), truth), topics, spoiler):
            odometry = odometry or Odometry(spoiler.camera(camera), settings)
            shown = odometry.process(frame)
            estimates.append(replace(shown, features=None, path=None, landmarks_map=None, loops=()))
    finally:
        source.close()
    if odometry is None:
        raise RecordingError("no frame with a calibration")
    trajectory = Trajectory.of(odometry.finish())
    bodies = {body: Trajectory.by_stamp(poses, trajectory) for body, poses in truth.items()}
    return Replayed(estimates, trajectory, bodies, odometry.timing)


def noting_truth(messages: Iterable[Message], truth: TruePoses) -> Iterator[Message]:
    """Yield the messages, and note the true poses among them."""
    for message in messages:
        if body := truth_body(message.topic):
            pose = decode_pose(message)
            truth.setdefault(body, {})[pose.stamp] = pose.T_parent_child
        yield message


def frames_of(
    messages: Iterable[Message], topics: Topics, spoiler: Spoiler = UNSPOILT, grey: bool = True
) -> Iterator[tuple[Camera, RgbdFrame]]:
    """Yield the calibration as recorded and each frame, spoilt; frames before a calibration are left out."""
    assembler = FrameAssembler(topics, grey)
    streams = dict.fromkeys(topics.color_keys, Stream.COLOR) | dict.fromkeys(topics.depth_keys, Stream.DEPTH)

    def spoilt(frames: Iterable[RgbdFrame]) -> Iterator[tuple[Camera, RgbdFrame]]:
        for frame in frames:
            if assembler.camera is not None and (kept := spoiler.frame(frame)) is not None:
                yield assembler.camera, kept

    for message in messages:
        stream = streams.get(message.topic)
        seen = replace(message, stamp=spoiler.stamp(stream, message.stamp)) if stream else message
        yield from spoilt(assembler.feed(seen))
    yield from spoilt(assembler.finish())
