"""The walk of the physical experiment: a source run through the odometry, its key poses kept on the way."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from odom.backend import Odometry, OdometrySettings
from odom.errors import ConfigError, RecordingError
from odom.evaluation.physical.front_ends import Look
from odom.evaluation.trajectory import Trajectory
from odom.frame import RgbdFrame
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.images import FrameImages
from odom.frontend.features.view import View
from odom.frontend.matching.optical_flow import follow_features
from odom.geometry import se3
from odom.geometry.arrays import Array, Image
from odom.service.replayed import TruePoses, frames_of, noting_truth
from odom.wire import Topics
from sensors.source import Source

APART_NS = 250_000_000
"""Time between the two looks of a pair, or the recording's length divided by the number of pairs, if that is less: on
the arena's walk, its key poses."""
_TWIST_FRAMES = 1
"""The camera's velocity at a key pose is that between so many frames before and after it."""


def check_length(source: str, frames: int | None, pairs: int) -> int:
    """Return the number of a source's frames; raises ConfigError where it is not known or too small."""
    if frames is None:
        raise ConfigError(f"{source} has no known end: record it, with motion capture, and give the recording")
    if frames <= pairs:
        raise ConfigError(f"{source}: {frames} frames are too few for {pairs} pairs, give a smaller --pairs")
    return frames


@dataclass(frozen=True, eq=False)
class PairOfLooks:
    """C_i (`target`) and C_i+1 (`source`), by their places among the looks.

    `followed` are corners of the target's image (n x 2 px) and where following them through the frames between ended in
    the source's image.
    """

    target: int
    source: int
    followed: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Walk:
    """What a source gave: looks in order of time, the pairs of them, the odometry's trajectory, and truth by body."""

    looks: list[Look]
    pairs: list[PairOfLooks]
    trajectory: Trajectory
    truth: dict[str, Trajectory]


def walk(
    source: Source, topics: Topics, settings: OdometrySettings, pairs: int, progress: Callable[[int], None]
) -> Walk:
    """Run the odometry over a source, keep `pairs` pairs of looks spread evenly over it, and close it.

    Raises ConfigError for a source of unknown length, or one too short; RecordingError where it has no frame with a
    calibration.
    """
    try:
        frames = check_length("the source", source.length if source.lossless else None, pairs)
        keeper = _Keeper(pairs, frames)
        odometry: Odometry | None = None
        truth: TruePoses = {}
        poses: dict[int, Array] = {}
        for camera, frame in frames_of(noting_truth(source.messages(), truth), topics, grey=False):
            odometry = odometry or Odometry(camera, settings)
            estimate = odometry.process(frame)
            if estimate.T_odom_camera is not None:
                poses[frame.stamp] = estimate.T_odom_camera
            keeper.add(frame, odometry)
            progress(keeper.seen)
    finally:
        source.close()
    if odometry is None:
        raise RecordingError("no frame with a calibration: look at the source with `odom info`")
    trajectory = Trajectory.of(odometry.finish())
    sensor = odometry.sensor
    looks = [
        Look(view, color, _twist(view.stamp, keeper.stamps, poses), sensor) for view, color in keeper.kept.values()
    ]
    place = {index: at for at, index in enumerate(keeper.kept)}
    made = [PairOfLooks(place[target], place[source], followed) for target, source, followed in keeper.pairs]
    return Walk(
        looks, made, trajectory, {body: Trajectory.by_stamp(found, trajectory) for body, found in truth.items()}
    )


def _twist(stamp: int, stamps: list[int], poses: dict[int, Array]) -> Array:
    """Return the camera's velocity at a frame (6, SI, its own frame), 0 where the poses around it are not known."""
    at = stamps.index(stamp)
    before, after = max(at - _TWIST_FRAMES, 0), min(at + _TWIST_FRAMES, len(stamps) - 1)
    first, last = poses.get(stamps[before]), poses.get(stamps[after])
    if first is None or last is None or after == before:
        return np.zeros(6)
    return se3.log(se3.inverse(first) @ last) / ((stamps[after] - stamps[before]) * 1e-9)


class _Keeper:
    """Keeps the looks of a walk, and follows the corners of the first of each pair to the second."""

    def __init__(self, pairs: int, frames: int) -> None:
        self.seen = 0
        self.stamps: list[int] = []
        self.kept: dict[int, tuple[View, Image]] = {}
        self.pairs: list[tuple[int, int, tuple[Array, Array]]] = []
        self._apart = max(1, (frames - 1) // pairs)
        self._begins = {round(at) for at in np.linspace(0, frames - 1 - self._apart, pairs)}
        self._open: list[_Following] = []
        self._before: FrameImages | None = None

    def add(self, frame: RgbdFrame, odometry: Odometry) -> None:
        """Take the next frame, which the odometry has just processed."""
        index, self.seen = self.seen, self.seen + 1
        self.stamps.append(frame.stamp)
        images = FrameImages.of(frame.color)
        going = []
        for each in self._open:
            assert self._before is not None
            each.follow(self._before, images)
            if index - each.begun >= self._apart or frame.stamp - each.stamp >= APART_NS:
                self._keep(index, frame, odometry, images)
                self.pairs.append((each.begun, index, each.followed))
            else:
                going.append(each)
        self._open, self._before = going, images
        if index in self._begins:
            self._keep(index, frame, odometry, images)
            corners = detect_corners(images.full, np.zeros((0, 2)), odometry.settings.cell_px, images.enlarged_from)
            self._open.append(_Following(index, frame.stamp, corners))

    def _keep(self, index: int, frame: RgbdFrame, odometry: Odometry, images: FrameImages) -> None:
        view = View.of(frame, index, odometry.sensor.clock, images)
        self.kept.setdefault(index, (view, frame.color))


class _Following:
    """Corners of frame `begun`, and where they are now."""

    def __init__(self, begun: int, stamp: int, corners: Array) -> None:
        self.begun, self.stamp = begun, stamp
        self._corners, self._now, self._step = corners, corners, np.zeros_like(corners)

    def follow(self, before: FrameImages, now: FrameImages) -> None:
        """Follow the corners into the next frame, from where they would be if they went on as before."""
        uv, found = follow_features(before.full, now.full, self._now, self._now + self._step, now.scale)
        self._step = (uv - self._now)[found]
        self._corners, self._now = self._corners[found], uv[found]

    @property
    def followed(self) -> tuple[Array, Array]:
        """Corners in the first image, and in the newest (n x 2 px each)."""
        return self._corners, self._now
