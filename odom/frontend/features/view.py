"""One frame as the odometry sees it: in the camera's steady time, with the images in which features are searched."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from odom.frame import RgbdFrame, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.stamp_clock import StampClock, SteadyStamp
from odom.frontend.features.depth_plane import has_depth
from odom.frontend.features.image_scale import scaled_mask
from odom.frontend.features.images import FrameImages
from odom.frontend.features.sparse_depth import dense_depth
from odom.geometry.arrays import Array, Mask, uniform


@dataclass(frozen=True, eq=False)
class View:
    """Frame `sequence`, whose colour image was stamped `stamp` and really taken at `steady_stamp` (see `StampClock`).

    `images` are the colour image's, `depth_mm` (H x W uint16, mm, 0: none) is the depth image stamped `depth_stamp`.
    `may_move` (H x W) marks what no feature should lie on, None where nothing is known of that. All have the size
    in which features are looked for (see `image_scale`). `number` counts the run's frames; a stamp or sequence number
    may come again where a recording is played in a loop.
    """

    sequence: int
    number: int
    stamp: Stamp
    steady_stamp: SteadyStamp
    images: FrameImages
    depth_stamp: Stamp
    depth_mm: NDArray[np.uint16]
    may_move: Mask | None = None

    @classmethod
    def of(
        cls, frame: RgbdFrame, number: int, clock: StampClock, images: FrameImages, may_move: Mask | None = None
    ) -> "View":
        """Return the view of a run's frame `number`, whose stamp is the newest of `clock`; `images` are its colour's.

        `may_move` is of the frame's own size. The view keeps none of the frame's arrays.
        """
        depth_mm = uniform(dense_depth(frame.depth_mm.copy(), images.scale))
        may_move = None if may_move is None else scaled_mask(may_move, images.scale)
        return cls(frame.sequence, number, frame.stamp, clock.steady, images, frame.depth_stamp, depth_mm, may_move)

    def without_depth(self) -> "View":
        """Return the view of a frame whose depth image says nothing."""
        return replace(self, depth_mm=uniform(np.zeros_like(self.depth_mm)))

    def stands(self, uv: Array) -> Mask:
        """Return which of n places in the image (n x 2 px) are not marked as what may move."""
        if self.may_move is None:
            return np.ones(len(uv), dtype=np.bool_)
        column, row = np.clip(uv.round().astype(int), 0, np.array(self.may_move.shape[::-1]) - 1).T
        return np.asarray(~self.may_move[row, column])

    @cached_property
    def shows_depth(self) -> bool:
        """Whether the depth image shows anything at all."""
        return has_depth(self.depth_mm)

    @property
    def late_s(self) -> float:
        """How much later than the steady time the stamp is, in seconds."""
        return (self.stamp - self.steady_stamp) * 1e-9

    def since_s(self, earlier: "View") -> float:
        """Return by how much the steady time is later than an `earlier` view's, in seconds."""
        return (self.steady_stamp - earlier.steady_stamp) * 1e-9

    def since_middle_s(self, timing: ShutterTiming) -> float:
        """Return how much later than its middle row's time the frame is stamped, in seconds."""
        return self.late_s + timing.since_middle_s

    @property
    def depth_delay_s(self) -> float:
        """How much later than the colour image's steady time the depth image was stamped, in seconds."""
        return (self.depth_stamp - self.steady_stamp) * 1e-9
