"""Coloured point clouds of key frames, and which of them are kept."""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, Stamp

KEYFRAMES = 160
"""Key frames whose clouds are kept, by the odometry for late viewers and by a viewer: less than 8 MB.
Beyond it every second one goes; more slow a browser down."""
_NEAR_MM, _FAR_MM = 300, 6000
"""Depth that is drawn: nearer is the operator's hand, farther a Kinect's noise (5 cm at 6 m) blurs the picture."""

Kept = TypeVar("Kept")


@dataclass(frozen=True, eq=False)
class Cloud:
    """n x 3 points (metres, camera frame) and their n x 3 RGB."""

    points: NDArray[np.float32]
    colors: NDArray[np.uint8]


def back_project(camera: Camera, color: NDArray[np.uint8], depth_mm: NDArray[np.uint16], limit: int) -> Cloud:
    """Return at most about `limit` pixels on a regular grid as points, those nearer than .3 m or beyond 6 m left out.

    Colour may be smaller than depth by a whole factor. Lens distortion is neglected: the cloud is for display only.
    """
    height, width = depth_mm.shape
    step = max(1, int(np.ceil(np.sqrt(height * width / limit))))
    v, u = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    mm = depth_mm[v, u]
    valid = (mm >= _NEAR_MM) & (mm <= _FAR_MM)
    u, v, z = u[valid], v[valid], mm[valid] * 1e-3
    points = np.column_stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z])
    smaller = -(-height // color.shape[0])
    pixels = color[v // smaller, u // smaller]
    return Cloud(points.astype(np.float32), pixels if pixels.ndim == 2 else np.repeat(pixels[:, None], 3, axis=1))


class KeyframeClouds(Generic[Kept]):
    """Clouds of key frames in order, at most `limit`: when there are more, every second one is dropped.

    The odometry asks `takes_next` before it computes a cloud, and after a thinning computes every second one only. A
    viewer that keeps what it receives then has the same clouds, whether it was there from the beginning or joined late.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._kept: OrderedDict[Stamp, Kept] = OrderedDict()
        self.newest: Stamp | None = None
        self._stride = 1
        self._seen = 0

    def takes_next(self) -> bool:
        """Count a new key frame and return whether its cloud is to be made and kept."""
        self._seen += 1
        return (self._seen - 1) % self._stride == 0

    def keep(self, keyframe: Stamp, cloud: Kept) -> list[Stamp]:
        """Keep the cloud; return the key frames whose clouds were dropped for it."""
        self.newest = keyframe
        self._kept[keyframe] = cloud
        if len(self._kept) <= self._limit:
            return []
        thinned = list(self._kept)[1::2]
        for stamp in thinned:
            del self._kept[stamp]
        self._stride *= 2
        return thinned

    def __getitem__(self, keyframe: Stamp) -> Kept:
        return self._kept[keyframe]

    def __iter__(self) -> Iterator[Stamp]:
        return iter(self._kept)

    def __len__(self) -> int:
        return len(self._kept)

    def __contains__(self, stamp: object) -> bool:
        return stamp in self._kept
