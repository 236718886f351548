"""OptiTrack as a source of truth: a NatNet server live, or a CSV file exported from Motive."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from odom.errors import InputError
from odom.evaluation.motive import T_ZUP_YUP, read_motive
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.quaternion import rotation_from_quaternion
from odom.wire import Message, truth
from odom.wire.codec import encode_pose
from sensors.optitrack.client import BodyPose, NatNetClient
from sensors.optitrack.settings import OptiTrackSettings

MOCAP_FRAME = "mocap"
"""Frame of the motion capture world, z up."""


class OptiTrackSource:
    """The rigid bodies of a NatNet server, each on `truth/<body>/pose` with its capture time."""

    lossless = False
    length: int | None = None

    def __init__(self, server: str, settings: OptiTrackSettings, seconds: float | None) -> None:
        self._y_up = settings.y_up
        self._seconds = seconds
        self.client = NatNetClient(server, settings)

    def messages(self) -> Iterator[Message]:
        """Yield the poses as they come."""
        for pose in self.client.poses():
            if self._seconds is not None and self.client.end_s is None:
                self.client.end_s = time.monotonic() + self._seconds
            T = _matrix(pose, self._y_up)
            if T is not None:
                yield encode_pose(truth(pose.name), pose.stamp, T, MOCAP_FRAME)

    def close(self) -> None:
        """Leave the server."""
        self.client.close()


def _matrix(pose: BodyPose, y_up: bool) -> Array | None:
    """Return T_mocap_body with z up, None for a pose that is none (not finite, or no rotation)."""
    T = np.eye(4)
    T[:3, 3] = pose.body.position
    try:
        T[:3, :3] = rotation_from_quaternion(np.array(pose.body.quaternion))
    except InputError:
        return None
    if not np.isfinite(T).all():
        return None
    return T_ZUP_YUP @ T if y_up else T


class MotiveFile:
    """A rigid body of a Motive CSV file on `truth/<body>/pose`; its stamps count from the capture's start."""

    lossless = True
    length: int | None = None

    def __init__(self, path: Path, settings: OptiTrackSettings) -> None:
        body = settings.body or None
        self._trajectory = read_motive(path, body, settings.y_up)
        self._topic = truth(body or path.stem)
        self._start_ns = round(settings.start_s * 1e9)

    def messages(self) -> Iterator[Message]:
        """Yield the poses in their order."""
        for stamp, T in zip(self._trajectory.stamps, self._trajectory.T_world_body, strict=True):
            yield encode_pose(self._topic, Stamp(int(stamp) + self._start_ns), T, MOCAP_FRAME)

    def close(self) -> None:
        """Nothing is open."""
