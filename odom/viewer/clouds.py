"""Coloured points of key frames, taken from the images as they come by."""

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, Stamp

_NEAR_MM, _FAR_MM = 300, 6000


@dataclass(frozen=True, eq=False)
class Cloud:
    """n x 3 points (metres, camera frame) and their n x 3 RGB."""

    points: NDArray[np.float32]
    colors: NDArray[np.uint8]


def back_project(camera: Camera, color: NDArray[np.uint8], depth_mm: NDArray[np.uint16], limit: int) -> Cloud:
    """Return at most about `limit` pixels on a regular grid as points, those nearer than .3 m or beyond 6 m left out.

    Lens distortion is left out too: this is for eyes.
    """
    height, width = depth_mm.shape
    step = max(1, int(np.ceil(np.sqrt(height * width / limit))))
    v, u = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    mm = depth_mm[v, u]
    valid = (mm >= _NEAR_MM) & (mm <= _FAR_MM)
    z = mm[valid] * 1e-3
    points = np.column_stack([(u[valid] - camera.cx) / camera.fx * z, (v[valid] - camera.cy) / camera.fy * z, z])
    pixels = color[v[valid], u[valid]]
    return Cloud(points.astype(np.float32), pixels if pixels.ndim == 2 else np.repeat(pixels[:, None], 3, axis=1))


class KeyframeClouds:
    """The clouds of the key frames, at most `limit`; when there are more, every second one goes.

    Images pass before it is known that theirs was a key frame, so what makes the clouds of the last `recent` images is
    kept. An image may have been thinned out: the nearest one within `nearest_s` stands in for it.
    """

    def __init__(self, limit: int, recent: int = 60, nearest_s: float = 0.2) -> None:
        self._limit = limit
        self._recent_limit = recent
        self._nearest = int(nearest_s * 1e9)
        self._recent: OrderedDict[Stamp, Callable[[], Cloud]] = OrderedDict()
        self._kept: OrderedDict[Stamp, Cloud] = OrderedDict()
        self._stride = 1
        self._seen = 0

    def remember(self, stamp: Stamp, cloud: Callable[[], Cloud]) -> None:
        """Keep what makes the cloud of an image for a while."""
        self._recent[stamp] = cloud
        while len(self._recent) > self._recent_limit:
            self._recent.popitem(last=False)

    def near(self, stamp: Stamp) -> Stamp | None:
        """Return the stamp of the remembered image nearest to `stamp`, None when none is near."""
        best = min(self._recent, key=lambda at: abs(at - stamp), default=None)
        return best if best is not None and abs(best - stamp) <= self._nearest else None

    def recall(self, stamp: Stamp) -> Cloud:
        """Return the cloud of the remembered image at `stamp`."""
        return self._recent[stamp]()

    def wants(self) -> bool:
        """Count a new key frame and return whether its cloud is to be kept."""
        self._seen += 1
        return (self._seen - 1) % self._stride == 0

    def keep(self, keyframe: Stamp, cloud: Cloud) -> list[Stamp]:
        """Keep the cloud (in the key frame's frame); return the key frames whose clouds had to go for it."""
        self._kept[keyframe] = cloud
        if len(self._kept) <= self._limit:
            return []
        thinned = list(self._kept)[1::2]
        for stamp in thinned:
            del self._kept[stamp]
        self._stride *= 2
        return thinned

    def __iter__(self) -> Iterator[tuple[Stamp, Cloud]]:
        return iter(self._kept.items())

    def __len__(self) -> int:
        return len(self._kept)

    def __contains__(self, stamp: object) -> bool:
        return stamp in self._kept
