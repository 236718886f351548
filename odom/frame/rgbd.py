"""One colour image and the depth image that belongs to it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.frame.brief import brief
from odom.frame.stamp import Stamp, checked_stamp
from odom.geometry.arrays import Image

_MOST_APART_NS = 1_000_000_000
"""Two images of one frame are some 20 ms apart; stamps further apart than a second come from different clocks."""
UNKNOWN_DEPTH_MM = 65535
"""The largest depth, which many drivers and data sets write where nothing was measured."""


@dataclass(frozen=True, eq=False, repr=False)
class RgbdFrame:
    """A colour image and the nearest depth image, each with its own capture stamp in nanoseconds.

    `color` is H x W x 3 uint8 RGB or H x W uint8 grey. OpenCV gives BGR, which looks the same to a program: convert it
    with `cv2.cvtColor(color, cv2.COLOR_BGR2RGB)`. `depth_mm` is H x W uint16 millimetres along the optical axis,
    registered to colour, 0 (REP-118) or 65535 where nothing was measured: the frame holds 0 for both. Its pose is that
    of the colour camera's optical frame (REP-103: x right, y down, z forward) at `stamp`, the colour image's.
    `sequence` counts frames.

    >>> import numpy as np
    >>> from odom import RgbdFrame, from_seconds
    >>> stamp = from_seconds(1.5)
    >>> RgbdFrame(0, stamp, np.zeros((480, 640, 3), np.uint8), stamp, np.zeros((480, 640), np.uint16))
    RgbdFrame(sequence=0, stamp=1500000000, color=uint8[480 x 640 x 3], depth_stamp=1500000000, \
depth_mm=uint16[480 x 640])

    Raises InputError, saying what to do, when a stamp is no integer or a type, shape or unit is another.
    """

    sequence: int
    stamp: Stamp
    color: Image
    depth_stamp: Stamp
    depth_mm: NDArray[np.uint16]

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "stamp", checked_stamp("the frame's stamp", self.stamp))
        object.__setattr__(self, "depth_stamp", checked_stamp("the depth's stamp", self.depth_stamp))
        if abs(self.depth_stamp - self.stamp) > _MOST_APART_NS:
            raise InputError(
                f"depth is stamped {(self.depth_stamp - self.stamp) * 1e-9:+.3f} s from colour: give both in "
                "nanoseconds of one clock; where depth has no stamp of its own, colour's twice"
            )
        _check_color(self.color)
        _check_depth(self.depth_mm, self.color.shape[:2])
        if self.depth_mm.max(initial=0) == UNKNOWN_DEPTH_MM:
            measured = np.where(self.depth_mm == UNKNOWN_DEPTH_MM, np.uint16(0), self.depth_mm)
            object.__setattr__(self, "depth_mm", measured)


def _check_color(color: Any) -> None:
    if not isinstance(color, np.ndarray):
        raise InputError(f"colour is a {type(color).__name__}: give a numpy array, numpy.asarray(image)")
    advice = ""
    if color.dtype.kind == "f":
        advice = "; where its values are 0 to 1, numpy.rint(255 * color).astype(numpy.uint8)"
    elif color.dtype == np.uint16:
        advice = "; or are colour and depth in each other's place?"
    elif color.ndim == 3 and color.shape[2] == 4:
        advice = "; leave out the fourth channel, color[:, :, :3]"
    elif color.ndim == 3 and color.shape[0] == 3 and color.shape[2] != 3:
        advice = "; channels come last, color.transpose(1, 2, 0)"
    elif color.ndim == 3 and color.shape[2] == 1:
        advice = "; a grey image has two axes, color[:, :, 0]"
    if color.dtype != np.uint8 or not (color.ndim == 2 or (color.ndim == 3 and color.shape[2] == 3)):
        raise InputError(f"colour is {color.dtype} of shape {color.shape}: give uint8, H x W x 3 or H x W{advice}")


def _check_depth(depth_mm: Any, size: tuple[int, ...]) -> None:
    if not isinstance(depth_mm, np.ndarray):
        raise InputError(f"depth is a {type(depth_mm).__name__}: give a numpy array, numpy.asarray(image)")
    if np.ma.isMaskedArray(depth_mm):
        raise InputError("depth is a masked array: give depth.filled(0), with 0 where nothing was measured")
    advice = ""
    if depth_mm.dtype.kind == "f":
        advice = "; of metres, numpy.rint(1000 * numpy.nan_to_num(depth)).astype(numpy.uint16)"
    elif depth_mm.dtype.kind in "iu" and depth_mm.dtype != np.uint16:
        advice = "; where these are millimetres, depth.astype(numpy.uint16)"
    elif depth_mm.shape == (*size, 1):
        advice = "; leave out the last axis, depth[:, :, 0]"
    elif depth_mm.shape != size:
        advice = "; depth has to be registered to the colour image, pixel by pixel"
    if advice or depth_mm.dtype != np.uint16:
        raise InputError(
            f"depth is {depth_mm.dtype} of shape {depth_mm.shape}: give uint16 millimetres of shape {size}, "
            f"the colour image's{advice}"
        )
