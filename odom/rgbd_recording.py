"""Frames and truth of a recording, for programs that use the odometry without its processes."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from odom.errors import RecordingError, SourceError
from odom.evaluation.files import read_tum
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp
from odom.wire import Topics, truth_body
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_pose
from odom.wire.recording import open_reader
from sensors.catalogue import open_source
from sensors.folder_layouts import is_image_folder, layout_of
from sensors.image_lists import pose_of
from sensors.source import SourceOptions

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
        assembler = FrameAssembler(Topics())
        source = open_source(str(self.path), self.options)
        try:
            for message in source.messages():
                yield from assembler.feed(message)
            yield from assembler.finish()
        finally:
            source.close()

    def truth(self) -> dict[str, Trajectory]:
        """Return the motion capture's trajectory of each body by its name; `camera` is the camera itself.

        Other bodies are markers on the camera, on a clock of their own: see `odom.calibrate`.
        """
        if (self.path / "rgb.txt").is_file():
            file = self.path / "groundtruth.txt"
            return {_CAMERA_TRUTH: read_tum(file)} if file.is_file() else {}
        if is_image_folder(self.path):
            entries = layout_of(self.path).truth
            T = np.array([pose_of(entry) for entry in entries])
            return {_CAMERA_TRUTH: Trajectory(np.array([entry.stamp for entry in entries]), T)} if entries else {}
        reader = open_reader(self.path)
        topics = {stream.topic for stream in reader.streams() if truth_body(stream.topic)}
        poses: dict[str, dict[Stamp, np.ndarray]] = {}
        for message in reader.messages(topics):
            pose = decode_pose(message)
            poses.setdefault(truth_body(message.topic) or "", {})[pose.stamp] = pose.T_parent_child
        return {body: Trajectory.by_stamp(found) for body, found in poses.items()}


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
        for message in source.messages():
            assembler.feed(message)
            if assembler.camera is not None:
                return RgbdRecording(Path(path), assembler.camera, options)
    finally:
        source.close()
    if start > 0.0 or end is not None:
        until = "its end" if end is None else f"{end:g} s"
        raise RecordingError(f"{path} holds no image from {start:g} s to {until}: `odom info {path}` tells its length")
    raise RecordingError(f"{path} holds no frame with a calibration: look at it with `odom info {path}`")
