"""Depth images of folders to millimetres: whole numbers in the folder's unit, numbers with a point in metres."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.wire.codec import rounded_mm

_BEYOND_MM = 65536
"""The least depth that 16 bits of millimetres do not hold."""


class NotDepthError(WireError):
    """An image that holds no distances."""


class NotMetresError(WireError):
    """An image of numbers with a point that cannot be metres."""


def depth_table(depth_scale: float, unknown: int = 0, rotated_bits: int = 0) -> NDArray[np.uint16] | None:
    """Return the millimetres of every 16-bit depth value, 0 beyond 65.535 m and for the value `unknown`.

    The values are rotated to the left by `rotated_bits`. It is None when the images hold what is wanted here:
    millimetres, unrotated, 0 where nothing is known.
    """
    if depth_scale == 1000.0 and unknown == 0 and rotated_bits == 0:
        return None
    values = np.arange(65536)
    values = values >> rotated_bits | values << (16 - rotated_bits) & 0xFFFF
    mm = np.rint(values * (1000.0 / depth_scale))
    mm[unknown] = 0
    return np.where(mm < _BEYOND_MM, mm, 0).astype(np.uint16)


def millimetres(depth: NDArray[Any], table: NDArray[np.uint16] | None) -> NDArray[np.uint16]:
    """Return H x W millimetres of an image as it is stored, 0 where nothing is known; `table` is `depth_table`'s.

    Numbers with a point are metres, whatever the folder's unit. Raises NotDepthError for what is no image of distances,
    NotMetresError for metres of which half are beyond what 16 bits of millimetres hold.
    """
    if depth.ndim != 2 or depth.dtype.kind not in "fiu" or depth.dtype.itemsize == 1:
        raise NotDepthError(f"depth image of type {depth.dtype} and shape {depth.shape}: expected 16-bit grey")
    if depth.dtype.kind == "f":
        return _of_metres(depth)
    if depth.dtype != np.uint16:
        depth = np.where((depth > 0) & (depth < _BEYOND_MM), depth, 0).astype(np.uint16)
    return depth if table is None else np.asarray(np.take(table, depth), dtype=np.uint16)


def _of_metres(depth: NDArray[Any]) -> NDArray[np.uint16]:
    mm = rounded_mm(depth)
    far = np.isfinite(depth) & (np.rint(depth * np.float64(1000.0)) >= _BEYOND_MM)
    if np.count_nonzero(far) > np.count_nonzero(mm):
        raise NotMetresError(
            f"depth image of type {depth.dtype}, whose numbers are metres: half of it is beyond 65.5 m; where they are "
            "millimetres, divide them by 1000, or write 16-bit PNG"
        )
    return mm
