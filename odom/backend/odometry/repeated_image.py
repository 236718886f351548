"""Images that come twice: from a driver that hangs, or in a stream that was brought to a higher rate."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.posed_frame import PosedFrame
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.view import View
from odom.geometry.arrays import Image

_Pixels = tuple[slice, ...]
"""Which pixels of an image are meant."""


@dataclass(frozen=True, eq=False)
class ShownDepth:
    """The `newest` view's depth image, the same since the steady time `since`; `comes_again`: with another stamp.

    A depth image that goes with two colour images keeps its stamp, by which it is used.
    """

    newest: View
    since: SteadyStamp
    comes_again: bool

    @classmethod
    def of(cls, view: View, before: "ShownDepth | None") -> "ShownDepth":
        """Return the depth that a view shows, where there was depth `before` (None: there was none)."""
        if before is None or not _are_equal(before.newest.depth_mm, view.depth_mm):
            return cls(view, view.steady_stamp, False)
        return cls(view, before.since, view.depth_stamp != before.newest.depth_stamp)

    def is_stale(self, last: PosedFrame | None, sensor: SensorModel) -> bool:
        """Return whether this is an earlier depth image once more, though the camera has moved since.

        The `last` frame with a pose tells how, if it came since then: after a loss the camera may well be at rest.
        """
        if not self.comes_again or last is None or last.tracked is None or last.view.steady_stamp < self.since:
            return False
        since_s = (self.newest.steady_stamp - self.since) * 1e-9
        return _moved_px(last, since_s, sensor) > TUNING.repeated_px


def is_repeated(view: View, last: PosedFrame, sensor: SensorModel) -> bool:
    """Return whether the view holds the image of the newest frame with a pose once more, though the camera may move.

    It would say that the camera has stopped. Two images of a real camera differ, if only by their noise; drawn ones of
    a camera at rest do not, and are no repetition. How the camera moves is not known by a segment's first frame. A
    clock that is written into the image, or a video codec, may change a few pixels of a repetition.
    """
    before, image = last.view.images.full, view.images.full
    if before.shape != image.shape or not _is_same_picture(before, image):
        return False
    return last.tracked is None or _moved_px(last, last.since_s(view.steady_stamp), sensor) > TUNING.repeated_px


def _moved_px(last: PosedFrame, since_s: float, sensor: SensorModel) -> float:
    """Return how far the image of the usual landmark moves in `since_s` seconds of the newest frame's motion (px)."""
    assert last.tracked is not None
    inverse_depth = last.tracked.measurements.values[:, 2]
    near = np.median(inverse_depth[np.isfinite(inverse_depth)]) if np.isfinite(inverse_depth).any() else 0.0
    speed_m_s, speed_rad_s = np.linalg.norm(last.twist.reshape(2, 3), axis=1)
    return float(sensor.lens.intrinsics[0] * (speed_rad_s + speed_m_s * near) * since_s)


def _is_same_picture(before: Image, image: Image) -> bool:
    """Return whether most pixels are equal, at edges too: where nothing is to be seen any two images are."""
    every = TUNING.repeated_rows
    if np.mean(before[::every] == image[::every]) <= TUNING.repeated_share:
        return False
    beside = np.index_exp[::every, :-1], np.index_exp[::every, 1:]
    below = np.index_exp[:-1:every], np.index_exp[1::every]
    shares = [s for s in (_equal_edges(before, image, *pixels) for pixels in (beside, below)) if s is not None]
    return min(shares) > TUNING.repeated_share if shares else _are_equal(before, image)


def _equal_edges(before: Image, image: Image, one: _Pixels, other: _Pixels) -> float | None:
    """Return which share of the pixels on both sides of an edge, between `one` and the `other`, are equal."""
    is_edge = np.abs(before[one].astype(np.int16) - before[other]) >= TUNING.repeated_contrast
    is_equal = [(before[side] == image[side])[is_edge] for side in (one, other)]
    return float(np.mean(is_equal)) if is_edge.any() else None


def _are_equal(a: NDArray[Any], b: NDArray[Any]) -> bool:
    middle = len(a) // 2  # of different images one row is, too
    return np.array_equal(a[middle], b[middle]) and np.array_equal(a, b)
