"""The part of a source that is examined, as it was received, with the images that could not be used."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from odom.evaluation.times import Stamps
from odom.evaluation.trajectory import Trajectory
from odom.frame import EXACT_DEPTH, Camera, RgbdFrame, corrected_depth
from odom.geometry.arrays import Mask

NO_FILE, NOT_DEPTH, OTHER_FORMAT = "no such file", "not 16-bit grey", "of a format that is not read"
NOT_METRES = "numbers with a point that are no metres"
"""Why an image could not be used, where a source knows more than a decoder's words."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A stretch of a source: all stamps of both streams (ns), the frames made from them, calibration and truth.

    `truth` maps the name of each body of the motion capture to its trajectory. `color_size` and `depth_size` are those
    of the first images, width and height, None when not known. `refused` counts images that could not be used by
    stream (`colour`, `depth`) and reason, `refused_stamps` those whose stamp does not go on from the one before.
    `mask` (H x W) marks what is known to be the camera's carrier, None where nothing is.
    """

    color_stamps: Stamps
    depth_stamps: Stamps
    frames: tuple[RgbdFrame, ...]
    camera: Camera | None
    truth: Mapping[str, Trajectory]
    color_size: tuple[int, int] | None = None
    depth_size: tuple[int, int] | None = None
    refused: Mapping[tuple[str, str], int] = field(default_factory=dict)
    refused_stamps: Mapping[tuple[str, str], int] = field(default_factory=dict)
    mask: Mask | None = None

    def as_corrected(self) -> "Recording":
        """Return the recording with its depth images corrected by what the calibration says of them."""
        if self.camera is None or self.camera.depth == EXACT_DEPTH:
            return self
        model = self.camera.depth
        frames = tuple(replace(frame, depth_mm=corrected_depth(frame.depth_mm, model)) for frame in self.frames)
        return replace(self, frames=frames, camera=replace(self.camera, depth=EXACT_DEPTH))

    @property
    def paired(self) -> tuple[RgbdFrame, ...]:
        """The frames that have a depth image: a colour image without one is a frame too, stamped alike in both."""
        came = np.isin([frame.depth_stamp for frame in self.frames], self.depth_stamps)
        return tuple(frame for frame, has_depth in zip(self.frames, came, strict=True) if has_depth)
