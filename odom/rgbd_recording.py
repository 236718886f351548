"""Frames and truth of a recording, for programs that use the odometry without its processes."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from odom.errors import InputError, RecordingError, SourceError, WireError
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp
from odom.geometry.arrays import Array
from odom.wire import Message, Topics, truth_body
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_pose
from odom.wire.recording import open_reader
from sensors.catalogue import open_source
from sensors.folder_layouts import is_image_folder, layout_of
from sensors.image_lists import TumEntry, pose_of
from sensors.source import Source, SourceOptions

log = logging.getLogger(__name__)

_CAMERA_TRUTH = "camera"
"""What a TUM folder's ground truth is of: the colour camera itself."""


@dataclass(frozen=True)
class RgbdRecording:
    """A recording's calibrated `camera` and its frames; each iteration reads them from the file again, in order.

    Made by `read_recording`. An image that cannot be decoded is logged and left out, as by `odom run`.
    """

    path: Path
    camera: Camera
    options: SourceOptions = field(repr=False)

    def __iter__(self) -> Iterator[RgbdFrame]:
        source = open_source(str(self.path), self.options)
        try:
            yield from _frames_of(source, FrameAssembler(Topics()))
        finally:
            source.close()

    def truth(self) -> dict[str, Trajectory]:
        """Return the motion capture's trajectory of each body by its name; `camera` is the camera itself.

        Other bodies are markers on the camera, on a clock of their own: see `odom.calibrate`. What is no pose is left
        out and told, as by `odom run`.
        """
        poses: dict[str, dict[Stamp, Array]] = {}
        wrong: list[Exception] = []
        for body, read in self._true_poses():
            try:
                stamp, T_world_body = read()
            except (WireError, ValueError) as error:
                wrong.append(error)
                continue
            poses.setdefault(body, {})[stamp] = T_world_body
        if wrong:
            log.warning("%s: %d true poses are left out, such as: %s", self.path, len(wrong), wrong[0])
        return {body: Trajectory.by_stamp(found) for body, found in poses.items()}

    def _true_poses(self) -> Iterator[tuple[str, Callable[[], tuple[Stamp, Array]]]]:
        """Yield the body of each true pose, and what reads it or raises."""
        if is_image_folder(self.path):
            for entry in layout_of(self.path).truth:
                yield _CAMERA_TRUTH, partial(_pose_of_line, entry)
            return
        reader = open_reader(self.path)
        topics = {stream.topic: body for stream in reader.streams() if (body := truth_body(stream.topic))}
        for message in reader.messages(set(topics)):
            yield topics[message.topic], partial(_pose_of_message, message)


def _pose_of_line(entry: TumEntry) -> tuple[Stamp, Array]:
    T_world_camera = pose_of(entry)
    if not np.isfinite(T_world_camera).all():
        raise InputError(f"the position at {entry.stamp / 1e9:.6f} s is not finite")
    return entry.stamp, T_world_camera


def _pose_of_message(message: Message) -> tuple[Stamp, Array]:
    pose = decode_pose(message)
    return pose.stamp, pose.T_parent_child


def read_recording(
    path: str | Path, camera: str | Path | None = None, *, start: float = 0.0, end: float | None = None
) -> RgbdRecording:
    """Open a recording, ROS bag or folder of images; `start` and `end` in seconds from its start.

    `camera` is a calibration file (ROS's or OpenCV's YAML, or ORB-SLAM's settings) that replaces the recording's own. A
    folder without any has that which is known by its name, or an average Kinect's, with a warning. Raises SourceError
    when the path cannot be opened, ConfigError when a recording lacks a calibration, RecordingError where no frame is
    found.
    """
    if not Path(path).exists():
        raise SourceError(f"{path}: no such file or folder; give a recording, ROS bag or folder of images")
    options = SourceOptions(camera=None if camera is None else Path(camera), start=start, end=end)
    source = open_source(str(path), options)
    assembler = FrameAssembler(Topics())
    try:
        for _ in _frames_of(source, assembler):
            if assembler.camera is not None:
                return RgbdRecording(Path(path), assembler.camera, options)
    finally:
        source.close()
    if (found := assembler.camera) is not None and assembler.malformed.counts[Topics().camera_info]:
        raise RecordingError(
            f"{path}: its colour images are not of the calibration's {found.width} x {found.height} pixels: give "
            "`camera` of their size"
        )
    if start > 0.0 or end is not None:
        until = "its end" if end is None else f"{end:g} s"
        raise RecordingError(f"{path} holds no image from {start:g} s to {until}: `odom info {path}` tells its length")
    raise RecordingError(f"{path} holds no frame with a calibration: look at it with `odom info {path}`")


def _frames_of(source: Source, assembler: FrameAssembler) -> Iterator[RgbdFrame]:
    for message in source.messages():
        yield from assembler.feed(message)
    yield from assembler.finish()
